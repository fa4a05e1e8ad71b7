// The panel "Live": the tool is moved by hand, in the scene or on a pad, and the chosen model
// answers at once.
import { get, remove, toError } from "./api.js";
import { byId, element, fill } from "./dom.js";
import { projectPointer, hitsTool } from "./drag.js";
import { capitalise, formatMm } from "./format.js";
import { nearestSpot, reliefPicture, surfacePaths } from "./height-map.js";
import { addPanel, openedPanel } from "./panels.js";
import { onViewerLoad, pageId, refreshScene } from "./scene.js";
import { subscribe, set, state } from "./store.js";

/** @import { EffectValues, HeightMap, LiveAnswer, Point } from "./types.js" */
/** @import { ViewerWindow, WhatIfRow } from "./types.js" */

/** @type {Record<string, string>} */
const MODELS = { raw: "Raw model", extended: "Extended model", whatif: "As set under What if" };
const PAD = 300; // width of the pad in pixels
const PAUSE = 8; // least time between requests [ms]
let retried = false; // a request has been repeated after a problem
/** @type {HTMLElement} */
let box;
/** @type {WebSocket | null} */
let socket = null;
let model = "extended";
/** @type {EffectValues[]} */
let extendedEffects = [];

/**
 * Requested place of the tool's centre.
 * @type {Point}
 */
let toolCentre = [];
let radius = 0.005; // of the tool [m]
/** @type {ReturnType<typeof setTimeout> | null} */
let sendTimer = null;
/** @type {LiveAnswer | null} */
let answer = null;
/** @type {number[]} */
let answerTimes = []; // of the last second [ms]
/**
 * While the tool is dragged in the scene: the point where it was grabbed, from there to its centre,
 * and whether it moves level.
 * @type {{ held: Point, offset: Point, level: boolean } | null}
 */
let dragState = null;

/** Add the panel. */
export function start() {
  box = addPanel("live", "Live", open, leave);
  onViewerLoad(watchViewer);
  // The server sends fields inside the block only while they are shown.
  subscribe(["section", "quantity", "layers"], () => {
    if (state().live && answer) send();
  });
  subscribe(["live"], drawBar);
  subscribe(["series"], () => {
    if (state().live) draw();
  });
  subscribe(["run", "sequence"], () => {
    if (openedPanel() === "live") {
      leave();
      open();
    }
  });
}

/** Set the model up and draw the panel. */
async function open() {
  const { run, sequence, heading, rendered } = state();
  if (!run || !sequence) {
    fill(box, mutedText("Choose a diagnosis on the left; here you then push its models by hand."));
    return;
  }
  if (!heading?.has_clouds) {
    fill(
      box,
      mutedText(
        "The dataset of this diagnosis is not where it was, so that its models cannot be set up.",
      ),
    );
    return;
  }
  fill(box, mutedText("Setting the model up …"));
  try {
    const found = await get(`/runs/${encodeURIComponent(run)}/model`);
    extendedEffects = found.effects ?? [];
    radius = found.setup?.tool?.radius ?? radius;
  } catch (error) {
    fill(
      box,
      element(
        "div",
        { class: "note-card bad" },
        element("strong", {}, "This cannot be led"),
        toError(error).message,
      ),
    );
    return;
  }
  if (openedPanel() !== "live") return;
  set({ live: true, playing: false });
  toolCentre = rendered?.drawn?.tool ?? aboveMiddle();
  answerTimes = [];
  answer = null;
  draw();
  connect();
}

/** Close the connection and show the recording again. */
async function leave() {
  if (!socket) return;
  socket.close();
  socket = null;
  dragState = null;
  set({ live: false });
  // The server does so as well when it sees the connection closed, but later.
  await remove(`/sessions/${pageId()}/live`).catch(() => {});
  refreshScene();
}

/**
 * @param {string} text
 * @returns {HTMLElement}
 */
const mutedText = (text) => element("p", { class: "muted" }, text);

/**
 * Return the lowest and the highest corner of the body.
 * @returns {[Point, Point]}
 */
const bodyCorners = () =>
  state().series?.box ?? [
    [-0.04, -0.02, 0],
    [0.04, 0.02, 0.04],
  ];

/**
 * Return the heights of the body's free surface; those of a flat block where they are unknown.
 * @returns {HeightMap}
 */
const surfaceMap = () => {
  const [low, high] = bodyCorners();
  const spacing = high[0] - low[0];
  return (
    state().series?.height_map ?? {
      corner: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2],
      spacing,
      heights: [[high[2]]],
    }
  );
};

/**
 * Return the place of the surface under the tool, or nearest to it.
 * @param {Point} place
 */
const underTool = ([x, y]) => nearestSpot(surfaceMap(), x, y);

/**
 * Return how far the tip of the tool is below the surface under it [m].
 * @param {Point} place
 * @returns {number}
 */
const depthBelow = (place) => underTool(place).z + radius - place[2];

/**
 * Return the place of the tool over the surface nearest to x, y, with its tip so far below it [m].
 * @param {number} x
 * @param {number} y
 * @param {number} below
 * @returns {Point}
 */
const overSurface = (x, y, below) => {
  const spot = nearestSpot(surfaceMap(), x, y);
  return [spot.x, spot.y, spot.z + radius - below];
};

/**
 * Return a place of the tool above the middle of the body.
 * @returns {Point}
 */
const aboveMiddle = () => {
  const [low, high] = bodyCorners();
  return overSurface((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, -radius);
};

/** Open the socket, and again if it closes while the panel is in front. */
function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const mine = new WebSocket(`${scheme}://${location.host}/api/sessions/${pageId()}/live`);
  socket = mine;
  mine.onopen = send;
  mine.onmessage = ({ data }) => {
    if (socket === mine) received(JSON.parse(data));
  };
  mine.onclose = () => {
    if (socket === mine) {
      socket = null;
      setTimeout(() => {
        if (openedPanel() === "live" && !socket) connect();
      }, 1500);
    }
  };
}

/**
 * Draw an answer; repeat the request once after a problem, because an ended solver is then
 * restarted.
 * @param {LiveAnswer} found
 */
function received(found) {
  answer = found;
  if (found.problem) {
    drawAnswer();
    if (!retried) {
      retried = true;
      setTimeout(send, 1000);
    }
    return;
  }
  retried = false;
  const now = performance.now();
  answerTimes = [...answerTimes.filter((at) => now - at < 1000), now];
  const { rendered } = state();
  if (rendered?.drawn && found.drawn)
    set({
      rendered: { ...rendered, drawn: { ...rendered.drawn, ...found.drawn, tool: found.tool } },
    });
  drawAnswer();
}

/**
 * Request the newest place, at most once in PAUSE, without waiting for answers: the server solves
 * the newest request and stays busy.
 */
function send() {
  if (sendTimer || socket?.readyState !== WebSocket.OPEN) return;
  sendTimer = setTimeout(() => {
    sendTimer = null;
    if (socket?.readyState !== WebSocket.OPEN) return; // sent again when the connection opens
    const { run, sequence } = state();
    socket.send(JSON.stringify({ run, sequence, at: toolCentre, ...modelRequest() }));
  }, PAUSE);
}

/**
 * Return the part of a request that chooses the model.
 * @returns {{ effects: EffectValues[], tuned: boolean, shown: string }}
 */
function modelRequest() {
  if (model === "raw") return { effects: [], tuned: false, shown: "raw" };
  const stored = model === "whatif" ? storedWhatIf() : null;
  const rows = stored ? stored.rows.filter((row) => row.on) : extendedEffects;
  return {
    effects: rows.map(({ effect, parameters }) => ({ effect, parameters })),
    tuned: stored?.tuned ?? true,
    shown: "extended",
  };
}

/**
 * Return what the panel "What if" has stored for this run.
 * @returns {{ rows: WhatIfRow[], tuned: boolean } | null}
 */
function storedWhatIf() {
  try {
    const stored = JSON.parse(sessionStorage.getItem("palpate.whatif") ?? "null");
    return stored?.run === state().run ? stored : null;
  } catch {
    return null;
  }
}

/** @param {Point} to */
function moveTool(to) {
  toolCentre = to;
  drawPad();
  send();
}

/**
 * Let the tool be dragged in the viewer.
 * @param {ViewerWindow} viewer
 */
function watchViewer(viewer) {
  /**
   * Return the tool's centre if it is under the pointer.
   * @param {PointerEvent} event
   * @returns {Point | null}
   */
  const toolUnder = (event) => {
    const tool = state().live && viewer.__viserMutable?.camera ? answer?.tool : null;
    return tool && hitsTool(viewer, event, tool, radius) ? tool : null;
  };
  viewer.addEventListener(
    "pointerdown",
    (event) => {
      const tool = event.button === 0 ? toolUnder(event) : null;
      if (!tool) return;
      event.stopImmediatePropagation();
      const held = projectPointer(viewer, event, tool, event.shiftKey);
      dragState = { held, offset: minus(tool, held), level: event.shiftKey };
      viewer.document.body.style.cursor = "grabbing";
    },
    true,
  );
  viewer.addEventListener(
    "pointermove",
    (event) => {
      if (!dragState) {
        if (state().live) viewer.document.body.style.cursor = toolUnder(event) ? "grab" : "";
        return;
      }
      event.stopImmediatePropagation();
      if (event.shiftKey !== dragState.level && answer) {
        const held = minus(answer.tool, dragState.offset);
        dragState = { ...dragState, held, level: event.shiftKey };
      }
      const { held, offset, level } = dragState;
      const at = projectPointer(viewer, event, held, level);
      moveTool(at.map((value, i) => value + offset[i]));
    },
    true,
  );
  for (const kind of ["pointerup", "pointercancel", "blur"])
    viewer.addEventListener(
      kind,
      () => {
        dragState = null;
        viewer.document.body.style.cursor = "";
      },
      true,
    );
}

/**
 * @param {Point} a
 * @param {Point} b
 * @returns {Point}
 */
const minus = (a, b) => a.map((value, i) => value - b[i]);

/** Draw the panel. */
function draw() {
  const lift = () => {
    const [, high] = bodyCorners();
    moveTool([toolCentre[0], toolCentre[1], high[2] + 2 * radius]);
  };
  fill(
    box,
    element("h1", { class: "verdict" }, "Push it yourself"),
    element(
      "p",
      { class: "gain-note" },
      "Drag the tool in the scene: down to push, with Shift to move it level. " +
        "Or lead it on the pad. Nobody measured these pushes, so the cloud is hidden.",
    ),
    element(
      "label",
      { class: "live-model" },
      "Model",
      element(
        "select",
        {
          "aria-label": "Model that answers",
          onchange: (event) => {
            model = event.target.value;
            answerTimes = [];
            send();
            event.target.blur();
          },
        },
        Object.entries(MODELS)
          .filter(([name]) => name !== "whatif" || storedWhatIf())
          .map(([name, label]) =>
            element("option", { value: name, selected: name === model }, label),
          ),
      ),
    ),
    element("div", { id: "live-answer", "aria-live": "polite" }),
    // The body from above comes with the series of the sequence, which may arrive later.
    element("div", { class: "live-pad" }, state().series ? [toolPad(), depthSlider()] : null),
    element(
      "div",
      { class: "actions" },
      element("button", { class: "button", type: "button", onclick: lift }, "Lift the tool"),
      element(
        "button",
        { class: "button", type: "button", onclick: () => moveTool(aboveMiddle()) },
        "Above the middle",
      ),
    ),
  );
  drawPad();
  drawAnswer();
}

/**
 * Convert a place of the tool to pixels of the pad.
 * @type {(place: Point) => [number, number]}
 */
let toPad = () => [0, 0];

/**
 * Create the pad: the body's free surface from above, over which the pointer or the arrow keys move
 * the tool; its depth below the surface stays. Beside the surface it goes to the nearest place.
 * @returns {SVGSVGElement}
 */
function toolPad() {
  const [low, high] = bodyCorners();
  const map = surfaceMap();
  const room = 2 * radius;
  const scale = PAD / (high[0] - low[0] + 2 * room);
  const tall = Math.round((high[1] - low[1] + 2 * room) * scale);
  const node = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  Object.entries({
    id: "live-pad",
    width: PAD,
    height: tall,
    viewBox: `0 0 ${PAD} ${tall}`,
    role: "application",
    "aria-label": "Tool from above; arrow keys move it by 1 mm",
    tabindex: 0,
  }).forEach(([key, value]) => node.setAttribute(key, String(value)));
  toPad = ([x, y]) => [(x - low[0] + room) * scale, (high[1] + room - y) * scale];
  const { outline, cells } = surfacePaths(map, (x, y) => toPad([x, y]));
  const [columns, rows] = [map.heights[0].length, map.heights.length];
  const [left, top] = toPad([
    map.corner[0] - map.spacing / 2,
    map.corner[1] + (rows - 0.5) * map.spacing,
  ]);
  const size = `width="${columns * map.spacing * scale}" height="${rows * map.spacing * scale}"`;
  node.innerHTML =
    `<path class="body" d="${cells}"/>` +
    `<image x="${left}" y="${top}" ${size} preserveAspectRatio="none"/>` +
    `<path class="outline" d="${outline}"/><circle r="${radius * scale}"/>`;
  node.querySelector("image")?.setAttribute("href", reliefPicture(map));
  /** @param {number} x @param {number} y */
  const moveOver = (x, y) => moveTool(overSurface(x, y, depthBelow(toolCentre)));
  /** @param {PointerEvent} event */
  const move = (event) =>
    moveOver(event.offsetX / scale + low[0] - room, high[1] + room - event.offsetY / scale);
  node.addEventListener("pointerdown", (event) => {
    node.setPointerCapture(event.pointerId);
    move(event);
  });
  node.addEventListener("pointermove", (event) => {
    if (event.buttons & 1) move(event);
  });
  /** @type {Record<string, [number, number] | undefined>} */
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  node.addEventListener("keydown", (event) => {
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    moveOver(toolCentre[0] + 1e-3 * step[0], toolCentre[1] + 1e-3 * step[1]);
  });
  return node;
}

/**
 * Create the slider for the depth of the tool's tip below the surface under it [mm].
 * @returns {HTMLElement}
 */
function depthSlider() {
  const [low, high] = bodyCorners();
  const most = 0.25 * Math.min(...high.map((value, i) => value - low[i])) * 1e3;
  return element(
    "label",
    { class: "live-depth" },
    "Below surface",
    element("input", {
      type: "range",
      id: "live-depth",
      min: -10,
      max: most.toFixed(1),
      step: 0.1,
      "aria-label": "Tool below the surface in mm",
      oninput: (event) =>
        moveTool(overSurface(toolCentre[0], toolCentre[1], +event.target.value / 1e3)),
    }),
    element("output", { id: "live-below" }),
  );
}

/** Show the requested place on pad and slider. */
function drawPad() {
  const node = document.getElementById("live-pad");
  if (!node || !toolCentre.length) return;
  const [x, y] = toPad(toolCentre);
  const circle = node.querySelector("circle");
  circle?.setAttribute("cx", String(x));
  circle?.setAttribute("cy", String(y));
  const below = depthBelow(toolCentre) * 1e3;
  const bar = byId("live-depth", HTMLInputElement);
  if (document.activeElement !== bar) bar.value = String(below);
  byId("live-below").textContent = `${below.toFixed(1)} mm`;
}

/** Show depth, force and rate over the scene. */
function drawBar() {
  const bar = byId("live-bar");
  const shown = state().live && answer && !answer.problem ? answer : null;
  bar.hidden = !shown;
  if (!shown) return;
  bar.classList.toggle("bad", !shown.converged);
  fill(
    bar,
    shown.converged
      ? [
          element("b", {}, formatMm(shown.depth)),
          element("b", {}, forceText(shown)),
          element("span", { class: "muted" }, answerRate() ? `${answerRate()}/s` : ""),
        ]
      : [element("b", {}, "No equilibrium")],
  );
}

/**
 * @param {LiveAnswer} live
 * @returns {string}
 */
const forceText = ({ force: components }) => {
  const force = Math.hypot(...components);
  return `${force.toFixed(force < 1 ? 3 : 2)} N`;
};

/**
 * Return the answers per second as text; empty while it is unknown.
 * @returns {string}
 */
const answerRate = () => {
  const seconds = (answerTimes[answerTimes.length - 1] - answerTimes[0]) / 1e3;
  return answerTimes.length > 1 ? ((answerTimes.length - 1) / seconds).toFixed(0) : "";
};

/** Draw the answer in the panel and over the scene. */
function drawAnswer() {
  drawBar();
  if (!document.getElementById("live-answer")) return;
  if (answer?.problem) {
    fill(
      "live-answer",
      element(
        "div",
        { class: "note-card bad" },
        element("strong", {}, "No answer"),
        answer.problem.message,
      ),
    );
    return;
  }
  if (!answer) {
    fill("live-answer", mutedText("Setting the model up …"));
    return;
  }
  /**
   * @param {string} label
   * @param {string} value
   * @param {string} id
   * @returns {HTMLElement}
   */
  const fact = (label, value, id) =>
    element("div", { class: "live-fact" }, element("span", {}, label), element("b", { id }, value));
  fill(
    "live-answer",
    element(
      "div",
      { class: "live-facts" },
      fact("Push depth", formatMm(answer.depth), "live-push"),
      fact("Force", forceText(answer), "live-force"),
      fact("Answers/s", answerRate() || "–", "live-rate"),
      fact("Solved in", `${(1e3 * answer.seconds).toFixed(0)} ms`, "live-solve"),
    ),
    answer.converged
      ? null
      : element(
          "div",
          { class: "note-card bad" },
          element("strong", {}, "No equilibrium"),
          `${capitalise(answer.outcome)}. The last one is shown.`,
        ),
  );
}
