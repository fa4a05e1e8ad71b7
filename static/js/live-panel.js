// Live: the tool is led by hand, in the scene or on a pad, and the chosen model answers at once.
import { get, remove } from "./api.js";
import { element, fill } from "./dom.js";
import { projectPointer, hitsTool } from "./drag.js";
import { capitalise, formatMm } from "./format.js";
import { addPanel, openedPanel } from "./panels.js";
import { onViewerLoad, pageId, refreshScene } from "./scene.js";
import { subscribe, set, state } from "./store.js";

const MODELS = { raw: "Raw model", extended: "Extended model", whatif: "As set under What if" };
const PAD = 300;
const PAUSE = 8; // ms
let retried = false;
let box = null;
let socket = null;
let model = "extended";
let extendedEffects = null; // the extended model's effects
let toolCentre = null; // of the tool's centre, as wished for [m]
let radius = 0.005;
let sendTimer = null;
let answer = null;
let answerTimes = [];
let dragState = null; // while the tool is dragged in the scene: from where its centre was held

export function start() {
  box = addPanel("live", "Live", open, leave);
  onViewerLoad(watchViewer);
  // What is seen inside is sent only where it is shown.
  subscribe(["section", "quantity", "layers"], () => {
    if (state().live && answer) send();
  });
  subscribe(["live"], drawBar);
  subscribe(["run", "sequence"], () => {
    if (openedPanel() === "live") {
      leave();
      open();
    }
  });
}

async function open() {
  const { run, sequence, heading, held } = state();
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
  } catch (problem) {
    fill(
      box,
      element(
        "div",
        { class: "note-card bad" },
        element("strong", {}, "This cannot be led"),
        problem.message,
      ),
    );
    return;
  }
  if (openedPanel() !== "live") return;
  set({ live: true, playing: false });
  toolCentre = held?.drawn?.tool ?? aboveMiddle();
  answerTimes = [];
  answer = null;
  draw();
  connect();
}

async function leave() {
  if (!socket) return;
  socket.close();
  socket = null;
  dragState = null;
  set({ live: false });
  await remove(`/sessions/${pageId()}/live`).catch(() => {}); // it goes with the connection, too, but somewhat later
  refreshScene();
}

const mutedText = (text) => element("p", { class: "muted" }, text);

const blockCorners = () =>
  state().series?.box ?? [
    [-0.04, -0.02, 0],
    [0.04, 0.02, 0.04],
  ];

const aboveMiddle = () => {
  const [low, high] = blockCorners();
  return [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2] + 2 * radius];
};

function connect() {
  const mine = new WebSocket(
    `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/sessions/${pageId()}/live`,
  );
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

function received(found) {
  answer = found;
  if (found.problem) {
    drawAnswer();
    if (!retried) {
      retried = true;
      setTimeout(send, 1000);
    } // a solver that ended is started anew when it is asked again
    return;
  }
  retried = false;
  const now = performance.now();
  answerTimes = [...answerTimes.filter((at) => now - at < 1000), now];
  const { held } = state();
  if (held?.drawn && found.drawn)
    set({ held: { ...held, drawn: { ...held.drawn, ...found.drawn, tool: found.tool } } });
  drawAnswer();
}

/** Ask for the newest place, at most once in `PAUSE`. No answer is awaited: the server solves the newest, and is not idle on the way. */
function send() {
  if (sendTimer || socket?.readyState !== WebSocket.OPEN) return;
  sendTimer = setTimeout(() => {
    sendTimer = null;
    if (socket?.readyState !== WebSocket.OPEN) return; // it is asked when the connection opens
    const { run, sequence } = state();
    socket.send(JSON.stringify({ run, sequence, at: toolCentre, ...modelRequest() }));
  }, PAUSE);
}

function modelRequest() {
  if (model === "raw") return { effects: [], tuned: false, shown: "raw" };
  const tried = model === "whatif" ? storedWhatIf() : null;
  const rows = tried ? tried.rows.filter((row) => row.on) : extendedEffects;
  return {
    effects: rows.map(({ effect, parameters }) => ({ effect, parameters })),
    tuned: tried?.tuned ?? true,
    shown: "extended",
  };
}

function storedWhatIf() {
  try {
    const kept = JSON.parse(sessionStorage.getItem("palpate.whatif"));
    return kept?.run === state().run ? kept : null;
  } catch {
    return null;
  }
}

function moveTool(to) {
  toolCentre = to;
  drawPad();
  send();
}

/** The viewer's own window, each time it is opened anew. */
function watchViewer(viewer) {
  const caught = (event) =>
    state().live &&
    answer?.tool &&
    viewer.__viserMutable?.camera &&
    hitsTool(viewer, event, answer.tool, radius);
  viewer.addEventListener(
    "pointerdown",
    (event) => {
      if (event.button !== 0 || !caught(event)) return;
      event.stopImmediatePropagation();
      const held = projectPointer(viewer, event, answer.tool, event.shiftKey);
      dragState = {
        held,
        off: answer.tool.map((value, i) => value - held[i]),
        level: event.shiftKey,
      };
      viewer.document.body.style.cursor = "grabbing";
    },
    true,
  );
  viewer.addEventListener(
    "pointermove",
    (event) => {
      if (!dragState) {
        if (state().live) viewer.document.body.style.cursor = caught(event) ? "grab" : "";
        return;
      }
      event.stopImmediatePropagation();
      if (event.shiftKey !== dragState.level)
        dragState = {
          ...dragState,
          held: answer.tool.map((value, i) => value - dragState.off[i]),
          level: event.shiftKey,
        };
      const at = projectPointer(viewer, event, dragState.held, dragState.level);
      moveTool(at.map((value, i) => value + dragState.off[i]));
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

function draw() {
  const raised = () => {
    const [, high] = blockCorners();
    moveTool([toolCentre[0], toolCentre[1], high[2] + 2 * radius]);
  };
  fill(
    box,
    element("h1", { class: "verdict" }, "Push it yourself"),
    element(
      "p",
      { class: "gain-note" },
      "Drag the tool in the scene: down to push, with Shift to move it level. Or lead it on the pad. Nobody measured these pushes, so the cloud is hidden.",
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
    element("div", { class: "live-pad" }, toolPad(), depthSlider()),
    element(
      "div",
      { class: "actions" },
      element("button", { class: "button", type: "button", onclick: raised }, "Lift the tool"),
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

/** The block from above; the tool is where the pointer is. */
function toolPad() {
  const [low, high] = blockCorners();
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
  }).forEach(([key, value]) => node.setAttribute(key, value));
  node.innerHTML = `<rect x="${room * scale}" y="${room * scale}" width="${(high[0] - low[0]) * scale}" height="${(high[1] - low[1]) * scale}" rx="3"/><circle r="${radius * scale}"/>`;
  node.place = ([x, y]) => [(x - low[0] + room) * scale, (high[1] + room - y) * scale];
  const move = (event) =>
    moveTool([
      event.offsetX / scale + low[0] - room,
      high[1] + room - event.offsetY / scale,
      toolCentre[2],
    ]);
  node.addEventListener("pointerdown", (event) => {
    node.setPointerCapture(event.pointerId);
    move(event);
  });
  node.addEventListener("pointermove", (event) => {
    if (event.buttons & 1) move(event);
  });
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  node.addEventListener("keydown", (event) => {
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    moveTool([toolCentre[0] + 1e-3 * step[0], toolCentre[1] + 1e-3 * step[1], toolCentre[2]]);
  });
  return node;
}

/** How far the tool reaches below the top, mm. */
function depthSlider() {
  const [low, high] = blockCorners();
  const most = 0.25 * Math.min(...high.map((value, i) => value - low[i])) * 1e3;
  return element(
    "label",
    { class: "live-depth" },
    "Below the top",
    element("input", {
      type: "range",
      id: "live-depth",
      min: -10,
      max: most.toFixed(1),
      step: 0.1,
      "aria-label": "Tool below the top in mm",
      oninput: (event) =>
        moveTool([toolCentre[0], toolCentre[1], high[2] + radius - +event.target.value / 1e3]),
    }),
    element("output", { id: "live-below" }),
  );
}

function drawPad() {
  const node = document.getElementById("live-pad");
  if (!node || !toolCentre) return;
  const [x, y] = node.place(toolCentre);
  const circle = node.querySelector("circle");
  circle.setAttribute("cx", x);
  circle.setAttribute("cy", y);
  const below = (blockCorners()[1][2] + radius - toolCentre[2]) * 1e3;
  const bar = document.getElementById("live-depth");
  if (document.activeElement !== bar) bar.value = below;
  document.getElementById("live-below").textContent = `${below.toFixed(1)} mm`;
}

/** The same numbers over the scene, where one looks while dragging. */
function drawBar() {
  const bar = document.getElementById("live-bar");
  bar.hidden = !state().live || !answer || Boolean(answer.problem);
  if (bar.hidden) return;
  bar.classList.toggle("bad", !answer.converged);
  fill(
    bar,
    answer.converged
      ? [
          element("b", {}, formatMm(answer.depth)),
          element("b", {}, forceText()),
          element("span", { class: "muted" }, answerRate() ? `${answerRate().toFixed(0)}/s` : ""),
        ]
      : [element("b", {}, "No equilibrium")],
  );
}

const forceText = () => {
  const force = Math.hypot(...answer.force);
  return `${force.toFixed(force < 1 ? 3 : 2)} N`;
};

const answerRate = () =>
  answerTimes.length > 1
    ? (answerTimes.length - 1) / ((answerTimes.at(-1) - answerTimes[0]) / 1e3)
    : null;

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
  const fact = (label, value, id) =>
    element("div", { class: "live-fact" }, element("span", {}, label), element("b", { id }, value));
  fill(
    "live-answer",
    element(
      "div",
      { class: "live-facts" },
      fact("Push depth", formatMm(answer.depth), "live-push"),
      fact("Force", forceText(), "live-force"),
      fact("Answers/s", answerRate() ? answerRate().toFixed(0) : "–", "live-rate"),
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
