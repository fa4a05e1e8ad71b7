// Live: the tool is led by hand, in the scene or on a pad, and the chosen model answers at once.
import { get, remove } from "./api.js";
import { element, fill } from "./dom.js";
import { led, onTool } from "./drag.js";
import { capital, mm } from "./format.js";
import { addPanel, openedPanel } from "./panels.js";
import { onViewer, pageId, refresh } from "./scene.js";
import { on, set, state } from "./store.js";

const MODELS = { raw: "Raw model", extended: "Extended model", whatif: "As set under What if" };
const PAD = 300;
const PAUSE = 8; // ms
let repeated = false;
let box = null;
let socket = null;
let model = "extended";
let known = null; // the extended model's effects
let place = null; // of the tool's centre, as wished for [m]
let radius = 0.005;
let waiting = null;
let answer = null;
let times = [];
let grip = null; // while the tool is dragged in the scene: from where its centre was held

export function start() {
  box = addPanel("live", "Live", open, leave);
  onViewer(watch);
  // What is seen inside is sent only where it is shown.
  on(["section", "quantity", "layers"], () => {
    if (state().live && answer) send();
  });
  on(["live"], drawBar);
  on(["run", "sequence"], () => {
    if (openedPanel() === "live") {
      leave();
      open();
    }
  });
}

async function open() {
  const { run, sequence, heading, held } = state();
  if (!run || !sequence) {
    fill(box, says("Choose a diagnosis on the left; here you then push its models by hand."));
    return;
  }
  if (!heading?.has_clouds) {
    fill(
      box,
      says(
        "The dataset of this diagnosis is not where it was, so that its models cannot be set up.",
      ),
    );
    return;
  }
  fill(box, says("Setting the model up …"));
  try {
    const found = await get(`/runs/${encodeURIComponent(run)}/model`);
    known = found.effects ?? [];
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
  place = held?.drawn?.tool ?? middle();
  times = [];
  answer = null;
  draw();
  connect();
}

async function leave() {
  if (!socket) return;
  socket.close();
  socket = null;
  grip = null;
  set({ live: false });
  await remove(`/sessions/${pageId()}/live`).catch(() => {}); // it goes with the connection, too, but somewhat later
  refresh();
}

const says = (text) => element("p", { class: "muted" }, text);

const corners = () =>
  state().series?.box ?? [
    [-0.04, -0.02, 0],
    [0.04, 0.02, 0.04],
  ];

const middle = () => {
  const [low, high] = corners();
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
    if (!repeated) {
      repeated = true;
      setTimeout(send, 1000);
    } // a solver that ended is started anew when it is asked again
    return;
  }
  repeated = false;
  const now = performance.now();
  times = [...times.filter((at) => now - at < 1000), now];
  const { held } = state();
  if (held?.drawn && found.drawn)
    set({ held: { ...held, drawn: { ...held.drawn, ...found.drawn, tool: found.tool } } });
  drawAnswer();
}

/** Ask for the newest place, at most once in `PAUSE`. No answer is awaited: the server solves the newest, and is not idle on the way. */
function send() {
  if (waiting || socket?.readyState !== WebSocket.OPEN) return;
  waiting = setTimeout(() => {
    waiting = null;
    if (socket?.readyState !== WebSocket.OPEN) return; // it is asked when the connection opens
    const { run, sequence } = state();
    socket.send(JSON.stringify({ run, sequence, at: place, ...chosen() }));
  }, PAUSE);
}

function chosen() {
  if (model === "raw") return { effects: [], tuned: false, shown: "raw" };
  const tried = model === "whatif" ? recall() : null;
  const rows = tried ? tried.rows.filter((row) => row.on) : known;
  return {
    effects: rows.map(({ effect, parameters }) => ({ effect, parameters })),
    tuned: tried?.tuned ?? true,
    shown: "extended",
  };
}

function recall() {
  try {
    const kept = JSON.parse(sessionStorage.getItem("palpate.whatif"));
    return kept?.run === state().run ? kept : null;
  } catch {
    return null;
  }
}

function lead(to) {
  place = to;
  drawPad();
  send();
}

/** The viewer's own window, each time it is opened anew. */
function watch(viewer) {
  const caught = (event) =>
    state().live &&
    answer?.tool &&
    viewer.__viserMutable?.camera &&
    onTool(viewer, event, answer.tool, radius);
  viewer.addEventListener(
    "pointerdown",
    (event) => {
      if (event.button !== 0 || !caught(event)) return;
      event.stopImmediatePropagation();
      const held = led(viewer, event, answer.tool, event.shiftKey);
      grip = { held, off: answer.tool.map((value, i) => value - held[i]), level: event.shiftKey };
      viewer.document.body.style.cursor = "grabbing";
    },
    true,
  );
  viewer.addEventListener(
    "pointermove",
    (event) => {
      if (!grip) {
        if (state().live) viewer.document.body.style.cursor = caught(event) ? "grab" : "";
        return;
      }
      event.stopImmediatePropagation();
      if (event.shiftKey !== grip.level)
        grip = {
          ...grip,
          held: answer.tool.map((value, i) => value - grip.off[i]),
          level: event.shiftKey,
        };
      const at = led(viewer, event, grip.held, grip.level);
      lead(at.map((value, i) => value + grip.off[i]));
    },
    true,
  );
  for (const kind of ["pointerup", "pointercancel", "blur"])
    viewer.addEventListener(
      kind,
      () => {
        grip = null;
        viewer.document.body.style.cursor = "";
      },
      true,
    );
}

function draw() {
  const raised = () => {
    const [, high] = corners();
    lead([place[0], place[1], high[2] + 2 * radius]);
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
            times = [];
            send();
            event.target.blur();
          },
        },
        Object.entries(MODELS)
          .filter(([name]) => name !== "whatif" || recall())
          .map(([name, label]) =>
            element("option", { value: name, selected: name === model }, label),
          ),
      ),
    ),
    element("div", { id: "live-answer", "aria-live": "polite" }),
    element("div", { class: "live-pad" }, pad(), depth()),
    element(
      "div",
      { class: "actions" },
      element("button", { class: "button", type: "button", onclick: raised }, "Lift the tool"),
      element(
        "button",
        { class: "button", type: "button", onclick: () => lead(middle()) },
        "Above the middle",
      ),
    ),
  );
  drawPad();
  drawAnswer();
}

/** The block from above; the tool is where the pointer is. */
function pad() {
  const [low, high] = corners();
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
    lead([event.offsetX / scale + low[0] - room, high[1] + room - event.offsetY / scale, place[2]]);
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
    lead([place[0] + 1e-3 * step[0], place[1] + 1e-3 * step[1], place[2]]);
  });
  return node;
}

/** How far the tool reaches below the top, mm. */
function depth() {
  const [low, high] = corners();
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
      oninput: (event) => lead([place[0], place[1], high[2] + radius - +event.target.value / 1e3]),
    }),
    element("output", { id: "live-below" }),
  );
}

function drawPad() {
  const node = document.getElementById("live-pad");
  if (!node || !place) return;
  const [x, y] = node.place(place);
  const circle = node.querySelector("circle");
  circle.setAttribute("cx", x);
  circle.setAttribute("cy", y);
  const below = (corners()[1][2] + radius - place[2]) * 1e3;
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
          element("b", {}, mm(answer.depth)),
          element("b", {}, newtons()),
          element("span", { class: "muted" }, rate() ? `${rate().toFixed(0)}/s` : ""),
        ]
      : [element("b", {}, "No equilibrium")],
  );
}

const newtons = () => {
  const force = Math.hypot(...answer.force);
  return `${force.toFixed(force < 1 ? 3 : 2)} N`;
};

const rate = () =>
  times.length > 1 ? (times.length - 1) / ((times.at(-1) - times[0]) / 1e3) : null;

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
    fill("live-answer", says("Setting the model up …"));
    return;
  }
  const fact = (label, value, id) =>
    element("div", { class: "live-fact" }, element("span", {}, label), element("b", { id }, value));
  fill(
    "live-answer",
    element(
      "div",
      { class: "live-facts" },
      fact("Push depth", mm(answer.depth), "live-push"),
      fact("Force", newtons(), "live-force"),
      fact("Answers/s", rate() ? rate().toFixed(0) : "–", "live-rate"),
      fact("Solved in", `${(1e3 * answer.seconds).toFixed(0)} ms`, "live-solve"),
    ),
    answer.converged
      ? null
      : element(
          "div",
          { class: "note-card bad" },
          element("strong", {}, "No equilibrium"),
          `${capital(answer.outcome)}. The last one is shown.`,
        ),
  );
}
