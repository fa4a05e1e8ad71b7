// What the panel "Import" does: files are sent, looks are asked for and opened, changed by hand,
// and imported. It draws nothing.
import { get, post, remove, toast, toError } from "./api.js";
import { createCutEditor, foundSequences, plain } from "./cut-editor.js";
import { datasetName, openImportDialog } from "./import-dialog.js";
import { createFileList } from "./import-sending.js";
import { withValues } from "./import-mapping.js";
import { addressOf, forget, remember, remembered } from "./import-memory.js";
import { takenStream } from "./import-setup.js";
import { watchJob } from "./job-watch.js";

/**
 * @import {
 *   CutEditor, ImportActions, ImportSetup, ImportView, Job, Look, LookRequest, StreamRole
 * } from "./types.js"
 */

/** @type {StreamRole[]} */
const ROLES = ["pose", "cloud", "camera", "wrench"];
/** @type {ImportSetup} */
const NO_SETUP = { kind: "none", name: "", text: null };

/**
 * @param {object} page
 * @param {() => void} page.redraw
 * @param {(dataset: string, said?: string[]) => unknown} page.openDataset
 * @param {() => void} page.opened called when another look is shown
 */
export function createImport({ redraw, openDataset, opened }) {
  /** @type {ImportView} */
  const view = {
    files: [],
    looks: [],
    datasets: [],
    setup: NO_SETUP,
    id: null,
    look: null,
    meaning: {},
    job: null,
    problem: null,
    name: "",
    recording: 0,
    time: 0,
    imported: null,
  };
  /** @type {CutEditor | null} */
  let editor = null;
  /** @type {LookRequest} */
  let request = {};
  const files = createFileList(view, redraw);

  /** Load the lists of looks and datasets. */
  async function refresh() {
    try {
      const [looks, { datasets }] = await Promise.all([get("/looks"), get("/datasets")]);
      Object.assign(view, { looks, datasets });
      redraw();
    } catch (problem) {
      toast(problem);
    }
  }

  /**
   * Follow a job; returns its result, or null where it failed or was cancelled.
   * @param {Promise<Job>} started
   * @returns {Promise<Record<string, any> | null>}
   */
  async function run(started) {
    Object.assign(view, { problem: null, imported: null });
    try {
      const ended = await watchJob(await started, (job) => {
        view.job = job;
        redraw();
        return true;
      });
      view.job = null;
      if (ended.state === "done") return ended.result;
      if (ended.error && ended.state !== "cancelled") view.problem = ended.error;
    } catch (problem) {
      view.job = null;
      view.problem = toError(problem);
    }
    redraw();
    return null;
  }

  /**
   * Ask for a look and show it in place of the one that is shown; what was changed by hand is
   * taken over where the times still mean the same.
   * @param {LookRequest} asked
   * @param {boolean} keepCut
   */
  async function ask(asked, keepCut = false) {
    const before = view.id;
    const { setup, meaning, name } = view;
    const sequences = keepCut && editor?.changed ? editor.sequences : undefined;
    const result = await run(post("/looks", asked));
    if (!result) return;
    remember(result.look, { request: asked, setup, meaning, name, sequences });
    await show(result.look);
    if (before && before !== result.look) await discard(before);
  }

  /**
   * Show a look with what is remembered of it.
   * @param {string} id
   */
  async function show(id) {
    /** @type {Look} */
    let look;
    try {
      look = await get(`/looks/${encodeURIComponent(id)}`);
    } catch (problem) {
      Object.assign(view, { problem: toError(problem), look: null, id: null });
      addressOf(null);
      redraw();
      return;
    }
    const known = remembered(id);
    request = known.request ?? look.request ?? { files: look.source.files };
    const same = view.look?.recordings[view.recording]?.name;
    const recording = Math.max(
      0,
      look.recordings.findIndex(({ name }) => name === same),
    );
    Object.assign(view, {
      id,
      look,
      recording,
      setup: known.setup ?? NO_SETUP,
      meaning: known.meaning ?? {},
      name: known.name || datasetName(look.source.name),
      problem: null,
      time: firstTime(look, recording),
    });
    editor =
      look.source.kind === "recording" && look.recordings.length
        ? createCutEditor(look.recordings, known.sequences ?? null, (cut) => {
            if (cut && editor) remember(id, { sequences: editor.sequences });
            redraw();
          })
        : null;
    addressOf(id);
    opened();
    redraw();
  }

  /** @param {string} id */
  async function discard(id) {
    forget(id);
    await remove(`/looks/${encodeURIComponent(id)}`).catch(toast);
    refresh();
  }

  /** Streams by role as they are taken; "" for none. */
  const takenStreams = () =>
    /** @type {Record<StreamRole, string>} */ (
      Object.fromEntries(ROLES.map((role) => [role, takenStream(view, role)]))
    );

  /** The text of import.toml with what was changed by hand. */
  const mapping = () =>
    view.look?.mapping && Object.keys(view.meaning).length
      ? withValues(view.look.mapping, view.meaning)
      : null;

  /** @param {ImportSetup} setup */
  const stated = ({ kind, name, text }) => ({
    setup: kind === "file" ? text : null,
    ...(kind === "dataset" ? { setup_dataset: name } : {}),
  });

  /** @type {ImportActions} */
  const actions = {
    redraw,
    addFiles: files.add,
    addPath: files.addPath,
    removeFile: files.remove,
    startLook: () => {
      const there = view.files.filter(({ token }) => token !== null);
      view.name = datasetName(there[0]?.name ?? "");
      ask({
        files: there.map(({ token }) => token ?? ""),
        ...stated(view.setup),
        mapping: null,
        streams: null,
        name: view.name || null,
      });
    },
    cancelJob: () => {
      if (view.job) post(`/jobs/${view.job.id}/cancel`).catch(toast);
    },
    openLook: show,
    removeLook: discard,
    startOver: () => {
      editor = null;
      Object.assign(view, { files: [], look: null, id: null, problem: null, imported: null });
      Object.assign(view, { setup: NO_SETUP, meaning: {}, name: "", recording: 0 });
      addressOf(null);
      refresh();
      redraw();
    },
    setRole: (stream, role) => {
      const streams = takenStreams();
      for (const one of ROLES) if (streams[one] === stream) streams[one] = "";
      if (role) streams[role] = stream;
      const samePose = streams.pose === takenStream(view, "pose");
      ask({ ...request, ...stated(view.setup), mapping: null, streams }, samePose);
    },
    setSetup: (setup) => {
      view.setup = setup;
      const streams = view.look?.error ? null : takenStreams();
      ask({ ...request, ...stated(setup), mapping: null, streams });
    },
    setMeaning: (key, value) => {
      view.meaning = { ...view.meaning, [key]: value };
      if (view.id) remember(view.id, { meaning: view.meaning });
      redraw();
    },
    lookAgain: () => ask({ ...request, mapping: mapping(), streams: null }, true),
    chooseRecording: (index, time) => {
      if (!view.look) return;
      Object.assign(view, { recording: index, time: time ?? firstTime(view.look, index) });
      redraw();
    },
    goTo: (time) => {
      view.time = time;
      redraw();
    },
    startImport: async () => {
      const { id, name } = view;
      if (!id) return;
      remember(id, { name });
      const result = await run(
        post(`/looks/${encodeURIComponent(id)}/import`, {
          name,
          mapping: mapping(),
          sequences: editor?.changed
            ? plain(editor.sequences).map((one) => ({ ...one, split: one.split ?? "none" }))
            : null,
        }),
      );
      if (!result) return;
      const { dataset, warnings = [] } = result;
      view.imported = { dataset, warnings };
      redraw();
      openDataset(dataset, warnings);
    },
    openDataset: (name) => openDataset(name, view.imported?.warnings ?? []),
    bringArchive: () => openImportDialog(),
  };

  return {
    view,
    actions,
    refresh,
    editor: () => editor,
    recording: () => view.look?.recordings[view.recording] ?? null,
    /** @param {string} recording */
    sequences: (recording) =>
      editor?.of(recording) ??
      foundSequences(view.look?.recordings ?? []).filter((one) => one.recording === recording),
    /** @param {string} name */
    lookAtDataset: async (name) => {
      const known = view.looks.find(
        ({ source }) => source?.kind === "dataset" && source.name === name,
      );
      if (known) await show(known.id);
      else {
        actions.startOver();
        await ask({ dataset: name });
      }
    },
  };
}

/**
 * Return the time of the deepest push of a recording, else its middle.
 * @param {Look} look
 * @param {number} index
 * @returns {number}
 */
function firstTime({ recordings }, index) {
  const recording = recordings[index];
  if (!recording) return 0;
  const { tool, start, end } = recording;
  const depths = tool?.depth?.map((depth) => depth ?? -Infinity) ?? [];
  const at = depths.indexOf(Math.max(...depths));
  return tool && at >= 0 ? tool.t[at] : (start + end) / 2;
}
