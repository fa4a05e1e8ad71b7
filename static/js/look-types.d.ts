// Types of looks at recordings, of their cut, and of the panel that imports them; read by the type
// checker only.
import type { FrameValues, Job, Rgb, ServerError } from "./types.js";

export type StreamRole = "pose" | "cloud" | "camera" | "wrench";
export type CutKind = "" | "top" | "side" | "drag" | "trace";

/** One stream of a recording; times in s on the clock of the poses. */
export interface LookStream {
  name: string;
  kind: string;
  type: string;
  samples: number;
  rate: number | null;
  delay: number | null;
  frame: string | null;
  role: StreamRole | null;
  gaps: [number, number][];
  faults: { t: number; text: string }[];
}

/** A part of a recording that becomes a sequence; times in s. */
export interface LookSequence {
  name: string;
  start: number;
  end: number;
  kind: CutKind | null;
  split: string | null;
}

/** What one recording holds; lengths in m, forces in N. */
export interface LookRecording {
  name: string;
  start: number;
  end: number;
  streams: LookStream[];
  tool: {
    t: number[];
    x: number[];
    y: number[];
    z: number[];
    /** Depth into the stated surface, negative while clear of it; null without a pose of the phantom. */
    depth: FrameValues | null;
  } | null;
  force: { t: number[]; fx: number[]; fy: number[]; fz: number[] } | null;
  clouds: { t: number[]; shown: number[] } | null;
  touches: { start: number; end: number; landmark: string }[];
  rest: [number, number] | null;
  sequences: LookSequence[];
}

export interface CloudReason {
  name: string;
  label: string;
  colour: string | Rgb;
}

/** A first look at a recording or a dataset, as the server stores it. */
export interface Look {
  id?: string;
  source: { kind: "recording" | "dataset"; files: string[]; name: string };
  dataset?: string | null;
  request?: LookRequest | null;
  mapping: string | null;
  setup_stated: boolean;
  decisions: string[];
  warnings: string[];
  error: ServerError | null;
  reasons?: CloudReason[];
  recordings: LookRecording[];
}

export interface LookRequest {
  files?: string[];
  setup?: string | null;
  setup_dataset?: string | null;
  mapping?: string | null;
  streams?: Partial<Record<StreamRole, string>> | null;
  name?: string | null;
  dataset?: string;
}

/** A look as the list has it. */
export interface LookEntry {
  id: string;
  job: Pick<Job, "state"> | null;
  /** What it is of; null before it is finished. */
  source: { kind: string; files: string[]; name: string; recordings: number } | null;
}

/** What the scene of a look shows. */
export interface LookScene {
  cloud: number | null;
  cloud_time: number | null;
  frame?: string;
  counts?: Record<string, number>;
  points?: number;
  cannot?: Record<string, string>;
}

/** A sequence while it is edited; `key` tells it apart whatever its name. */
export interface CutSequence extends LookSequence {
  key: number;
  recording: string;
}

/** What is wrong with one field of a sequence. */
export interface CutProblem {
  key: number;
  field: "name" | "start" | "end";
  text: string;
}

/** The sequences of a look with the functions that change them; see cut-editor.js. */
export interface CutEditor {
  readonly sequences: CutSequence[];
  readonly selected: number | null;
  readonly changed: boolean;
  of: (recording: string) => CutSequence[];
  chosen: () => CutSequence | null;
  select: (key: number | null) => void;
  neighbour: (recording: string, by: number) => void;
  resize: (key: number, edge: "start" | "end", time: number, drag?: boolean) => void;
  alter: (key: number, changes: Partial<Pick<CutSequence, "name" | "kind" | "split">>) => void;
  add: (recording: string, start: number, end: number) => void;
  split: (key: number, time: number) => void;
  remove: (key: number) => void;
  release: () => void;
  undo: () => void;
  redo: () => void;
  canUndo: () => boolean;
  canRedo: () => boolean;
  revert: () => void;
  problems: () => CutProblem[];
}

/** A file that is sent to the server, or a path there. */
export interface ImportFile {
  key: number;
  name: string;
  size: number | null;
  /** Part that has been sent, 0 to 1. */
  share: number;
  /** What the server calls it; null while it is being sent. */
  token: string | null;
  problem: string | null;
  cancel: (() => void) | null;
}

export interface ImportSetup {
  kind: "none" | "file" | "dataset";
  name: string;
  text: string | null;
}

/** What the panel of imports shows. */
export interface ImportView {
  files: ImportFile[];
  looks: LookEntry[];
  datasets: string[];
  setup: ImportSetup;
  id: string | null;
  look: Look | null;
  /** Changes of import.toml by table and key, as TOML. */
  meaning: Record<string, string>;
  job: Job | null;
  problem: ServerError | null;
  name: string;
  recording: number;
  time: number;
  imported: { dataset: string; warnings: string[] } | null;
}

export interface ImportActions {
  redraw: () => void;
  addFiles: (files: Iterable<File>, folders?: string[]) => void;
  addPath: (path: string) => void;
  removeFile: (key: number) => void;
  startLook: () => void;
  cancelJob: () => void;
  openLook: (id: string) => void;
  removeLook: (id: string) => void;
  startOver: () => void;
  setRole: (stream: string, role: StreamRole | null) => void;
  setSetup: (setup: ImportSetup) => void;
  setMeaning: (key: string, value: string) => void;
  lookAgain: () => void;
  chooseRecording: (index: number, time?: number) => void;
  goTo: (time: number) => void;
  startImport: () => void;
  openDataset: (name: string) => void;
  bringArchive: () => void;
}

/** Time scale and places of the lanes of a look's timeline, in CSS pixels. */
export interface LookScale {
  x: (time: number) => number;
  timeAt: (pixel: number) => number;
  left: number;
  right: number;
  sequences: [number, number] | null;
  lanes: { name: string; top: number; bottom: number }[];
}
