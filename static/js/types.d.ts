// Types of the server's answers and of what modules share; read by the type checker only.
export * from "./look-types.js";

/** Coordinates [x, y, z] in metres, in the phantom frame unless said otherwise. */
export type Point = number[];
export type Rgb = number[];
export type Model = "raw" | "extended" | "corrected";
export type Quantity = "error" | "displacement" | "energy";
export type Axis = "x" | "y" | "z";
/** A number for each frame; null where there is none. */
export type FrameValues = (number | null)[];
/** Values of an effect's parameters by name, in SI units. */
export type ParameterValues = Record<string, number | string>;

/** An error as the server sends it. */
export interface ServerError {
  kind?: string;
  message: string;
  where?: Record<string, string | number | boolean>;
}

export interface Palette {
  signed: Rgb[];
  sequential: Rgb[];
  things: Record<string, Rgb>;
}

/** How one layer is drawn; what is absent follows the choice for all layers. */
export interface LayerStyle {
  opacity?: number;
  coloured?: boolean;
  lines?: boolean;
}

/** A cut through the block: `at` is the coordinate [m] along `axis`. */
export interface Section {
  on: boolean;
  axis: Axis;
  at: number;
  flip: boolean;
}

export interface SequenceEntry {
  name: string;
  frames: number;
  seconds: number;
  split: string | null;
  distance_raw: number | null;
  distance_extended: number | null;
}

/** A run as the list of runs has it. */
export interface RunEntry {
  id: string;
  dataset: string;
  folder: string | null;
  verdict: string;
  causes: string[];
  created: number;
  data_changed?: boolean | null;
}

export interface RunHeading extends RunEntry {
  sentence: string;
  notes?: string[];
  stiffness?: string[];
  ranking?: RankingRow[];
  ranking_note?: string;
  limits?: LimitRow[];
  /** Probabilities of the causes as texts. */
  chances?: string[];
  size: number[];
  has_clouds: boolean;
  sequences: SequenceEntry[];
}

/** One sequence for the timeline: times in s, lengths in m, forces in N. */
export interface Series {
  name: string;
  time: number[];
  models: Model[];
  distance_raw: FrameValues;
  distance_extended?: FrameValues;
  distance_corrected?: FrameValues;
  noise_floor: number | null;
  depth: FrameValues | null;
  touching: [number, number][];
  force: FrameValues | null;
  forces: Partial<Record<Model, FrameValues>> | null;
  iterations: Partial<Record<Model, number[]>> | null;
  failed?: Partial<Record<Model, number[]>>;
  /** Why a model found no equilibrium, for each of its failed frames. */
  reasons?: Partial<Record<Model, string[]>>;
  worst: number[];
  limits: Record<Quantity, number | null>;
  /** Why the run holds no fields inside the block; null where it does. */
  inside: string | null;
  lumps: number | boolean;
  landmarks: number | boolean;
  box: [Point, Point];
  /** Heights [m] of the free surface from above; rows along y, null where there is none. */
  height_map: HeightMap;
}

/** `corner` is the middle of the first cell, `spacing` a cell's edge length [m]. */
export interface HeightMap {
  corner: [number, number];
  spacing: number;
  heights: (number | null)[][];
}

export interface ViewRequest {
  run: string | null;
  sequence: string | null;
  frame: number;
  layers: string[];
  colour: string;
  quantity: Quantity;
  scale: "robust" | "fixed";
  limit: number | null;
  crop: boolean;
  side_by_side: boolean;
  section: Omit<Section, "on"> | null;
  looks: Record<string, LayerStyle>;
}

/** What the scene shows, as the server last said. */
export interface RenderedScene {
  view: ViewRequest | null;
  drawn: { tool?: Point | null; quantity?: Quantity | null; limit?: number | null } | null;
}

/** Everything the page shows; see store.js. */
export interface State {
  run: string | null;
  sequence: string | null;
  frame: number;
  playing: boolean;
  layers: string[];
  colour: string;
  quantity: Quantity;
  ranges: Partial<Record<Quantity, string>>;
  limits: Partial<Record<Quantity, number>>;
  looks: Record<string, LayerStyle>;
  side_by_side: boolean;
  section: Section | null;
  crop: boolean;
  speed: number;
  loop: [number, number] | null;
  report: Report | null;
  heading: RunHeading | null;
  series: Series | null;
  palette: Palette | null;
  rendered: RenderedScene | null;
  trial: boolean;
  live: boolean;
  theme: string;
}

/** A value with its unit and interval, in SI units. */
export interface Estimate {
  value: number | string;
  unit: string;
  low?: number | null;
  high?: number | null;
  identifiability?: string;
}

export interface Cause {
  effect: string;
  probability?: number;
  parameters?: Record<string, Estimate>;
  cover?: Estimate;
  depth?: Estimate;
  /** Places [m] in the frame of the dataset's files, of a phantom that was turned upright. */
  in_file_frame?: { centre?: Point; polyline?: Point[] };
}

export interface Share {
  value: number | null;
  low: number | null;
  high: number | null;
}

export interface Gain {
  split: string;
  unit?: string;
  baseline: number | null;
  extended: number | null;
  baseline_network?: number | null;
  extended_network?: number | null;
  noise_floor: number | null;
  reducible_removed?: Share | null;
  tuned?: { value: number | null } | null;
  paper_metric?: { baseline?: number | null; extended?: number | null } | null;
}

export interface DetectionLimit {
  unit?: string;
  change?: number | null;
  factor?: number | null;
  share?: number | null;
}

export interface LimitRow {
  effect: string;
  size: string;
  like: string;
}

export interface ControlRow {
  control: string;
  effect: string;
  kept: number;
  passed: boolean | null;
  why?: string;
}

export interface ProbeProposal {
  text: string;
  separates: string[];
  probability?: number;
}

export interface Unexplained {
  fraction: number;
  where?: string;
  when?: string;
  structure?: number;
  structure_bound?: number;
  rms_mm?: number | null;
  share_of_motion?: number | null;
  tolerance_mm?: number;
  clues?: ErrorClues;
}

export interface ErrorClues {
  rms_mm_when: Record<string, number>;
  grows_with_push: number | null;
  moves_with: Record<string, number>;
  worst_frames: { sequence: string; time_s: number; rms_mm: number }[];
  partial_causes: { effects: string[]; gain_nats: number; left: number }[];
  measure_next: string;
}

export interface RankingRow {
  effect: string;
  /** Of the error that it alone removes, for its bar [1]. */
  share: number;
  removed: string;
  probability: string;
  named: boolean;
}

export interface Palpation {
  pushes: number;
  depth: Estimate;
  force: Estimate;
  young_modulus?: Estimate;
}

export interface Report {
  verdict: string;
  causes?: Cause[];
  gain?: Gain;
  palpation?: Palpation;
  stiffness_map?: { structured: boolean };
  controls?: ControlRow[];
  next_probe?: ProbeProposal[];
  unexplained?: Unexplained;
  small_remainder?: Unexplained | null;
  identified?: { effect: string; why?: string; parameters: Record<string, Estimate> }[];
  not_identifiable?: { effect: string; why?: string; measure_instead?: string }[];
}

/** Patches of the surface with the error in m; null where a patch was not seen. */
export interface Patterns {
  centres: Point[];
  normals: Point[];
  measured: FrameValues;
  predicted: FrameValues;
  limit: number;
}

export interface Comparison {
  runs: RunEntry[];
  sequences: { sequence: string; models: Record<string, ComparisonRow | undefined> }[];
}

export interface ComparisonRow {
  split: string | null;
  raw: number | null;
  extended: number | null;
  noise_floor: number | null;
  removed?: number | null;
}

/** Times in seconds since 1970. */
export interface Job {
  id: string;
  kind: string;
  dataset: string | null;
  state: string;
  fraction: number;
  text: string;
  created: number;
  started: number | null;
  finished: number | null;
  error: ServerError | null;
  result: (Record<string, string> & { files?: string[] }) | null;
  attempt: number;
  remaining: number | null;
  can_retry: boolean;
}

export interface LogEntry {
  at: number;
  level: string;
  text: string;
}

export interface DatasetSummary {
  name: string;
  size: number[];
  mass: number;
  tool_radius: number;
  touches: number;
  has_rest: boolean;
  sequences: { name: string; clouds: number; split: string | null }[];
  warnings: string[];
  lacks: string[];
}

export interface DiskUsage {
  used: number;
  caches: number;
  limit: number;
  largest: StoredResult[];
}

/** A result that takes room; its time in s since 1970. */
export interface StoredResult {
  kind: string;
  name: string;
  bytes: number;
  created: number;
}

/** A parameter in the catalogue of effects. */
export interface Parameter {
  name: string;
  unit: string;
  low: number | null;
  high: number | null;
  choices: string[];
  scale: number | null;
  log: boolean;
  contrast: boolean;
  /** Of a dataset: values that make sense in its phantom, and a value where it is not varied. */
  span?: [number, number] | null;
  begin?: number | string | null;
}

export interface Effect {
  name: string;
  summary: string;
  by_hand: boolean;
  /** Of a dataset: why it cannot have the effect. */
  impossible?: string | null;
  parameters: Parameter[];
}

export interface EffectValues {
  effect: string;
  parameters: ParameterValues;
}

/** A cause in the panel "What if"; `on` says whether it is in the model. */
export interface WhatIfRow extends EffectValues {
  on: boolean;
}

export interface WhatIfAnswer {
  distance?: number | null;
  distance_raw?: number | null;
  distance_extended?: number | null;
  noise_floor?: number | null;
  converged?: boolean;
  outcome?: string;
  notes?: string[];
  problem?: ServerError;
  /** True while a newer answer is awaited. */
  waiting?: boolean;
}

/** Effects of the run's model, initial values of all others, those that this phantom cannot have
 * with the reason, and the lowest and highest value [SI] that numbers of an effect have in it. */
export interface WhatIfChoices {
  model: EffectValues[];
  beginnings: EffectValues[];
  impossible: Record<string, string>;
  spans: Record<string, Record<string, [number, number]>>;
}

export interface LiveAnswer {
  depth: number;
  force: number[];
  tool: Point;
  converged: boolean;
  outcome: string;
  seconds: number;
  drawn: { quantity?: Quantity | null; limit?: number | null } | null;
  problem?: ServerError;
}

/** The parts of viser's client that the page reads; three.js objects. */
export interface ViserClient {
  nodeRefFromName: Record<string, { matrixWorld: { elements: number[] } }>;
  canvas: HTMLCanvasElement;
  camera: {
    position: { x: number; y: number; z: number };
    matrixWorld: { elements: number[] };
    matrixWorldInverse: { elements: number[] };
    projectionMatrix: { elements: number[] };
    projectionMatrixInverse: { elements: number[] };
  };
  cameraControl?: {
    _target?: { x: number; y: number; z: number };
    getTarget(): { x: number; y: number; z: number };
  };
}

/** The window of the 3D viewer; its client is there once the scene has loaded. */
export type ViewerWindow = Window & { __viserMutable?: ViserClient };

/** A swept parameter while it is edited: `name` is "effect.parameter"; bounds in SI units. */
export interface SweepBounds {
  name: string;
  low: number;
  high: number;
}

/** A swept parameter as an axis of a plot. */
export interface PlotAxis extends SweepBounds {
  log: boolean;
  /** Value of the setup as stated; undefined where it has none. */
  stated?: number;
  label: string;
  unit: string;
  /** A value with its unit. */
  show: (value: number) => string;
  /** A value without its unit. */
  plain: (value: number) => string;
}

export interface SweepPoint {
  number: number;
  kind: string;
  values: Record<string, number>;
  error: number | null;
  failure?: string | null;
}

export interface SweepDirection {
  name: string;
  flat: boolean | null;
  change: number;
  low: number;
  high: number;
  little?: boolean;
  least?: [number, number] | null;
  edge?: "" | "low" | "high";
}

export interface Sweep {
  id: string;
  job: Job | null;
  request: {
    parameters: { parameter: string; low: number; high: number }[];
    fixed?: Record<string, number | string>;
  } | null;
  summary: {
    directions: SweepDirection[];
    sentence?: string;
    at_rest?: number;
    stated_values?: Record<string, number>;
  } | null;
  data_changed: boolean | null;
}

/** Errors in mm. */
export interface LadderSummary {
  folder: string;
  sentence: string;
  rungs: Rung[];
  parts: LadderPart[];
}

export interface Rung {
  name: string;
  label: string;
  network: { kind: string } | null;
}

export interface LadderPart {
  part: string;
  kinds: string[];
  probes: number;
  noise_floor: number;
  errors: Record<string, { error: number; low: number; high: number; removed: Share }>;
}

export interface TrainingSummary {
  folder: string;
  validation_error_mm: number;
  validation_error_without_mm: number;
}

export interface Training {
  id: string;
  job: Job | null;
  request: { run: string | null } | null;
  history: number[][];
  summary: TrainingSummary | null;
  data_changed: boolean | null;
}

export interface Evaluation {
  id: string;
  job: Job | null;
  summary: LadderSummary | null;
  data_changed: boolean | null;
}

export type Side = "cloud" | "mesh";

/** A pair of a registration by hand: cloud in the camera frame, mesh in the phantom frame. */
export interface PointPair {
  cloud: Point | null;
  mesh: Point | null;
  landmark: string | null;
}

export type CompletePair = PointPair & { cloud: Point; mesh: Point; number: number };

export interface IcpResult {
  registration: {
    phantom_from_camera: number[][];
    residual_before: number;
    residual_after: number;
    points: number;
    moved: number;
    turned: number;
    directions: { parts: Record<string, number>; sigma: number }[];
    weak_directions: string[];
    warnings: string[];
  };
}

export interface PairValues {
  pairs: PointPair[];
  mode: Side;
  chosen: [number, Side] | null;
  start: string;
  over: boolean;
  found: IcpResult | null;
}

/** The rigid fit of the pairs; `of` has their numbers in the list. */
export interface PairFit {
  rms: number;
  residuals: number[];
  phantom_from_camera: number[][];
  warnings: string[];
  of: number[];
}

/** What the panel of registration shows beside the pairs. */
export interface RegisterView {
  dataset: string | null;
  datasets: string[];
  folder: string | null;
  fit: PairFit | null;
  /** Why the pairs have no fit; `at` has the numbers of the pairs concerned. */
  problem: (ServerError & { at: number[] }) | null;
  busy: string | null;
  names: string[];
  landmarks: Record<string, Point>;
  stated: boolean;
  cannot: ServerError | null;
  refused: ServerError | null;
  missed: string | null;
  accepted: string | null;
}

export interface RegisterActions {
  choose: (dataset: string) => Promise<void>;
  refine: (accept?: string | null) => Promise<void>;
  accept: (name: string) => void;
  back: () => void;
  openDataset: () => void;
  clear: () => void;
  look: () => void;
  landmark: (name: string) => void;
  nudge: (right: number, up: number) => Promise<void>;
}

/** The pairs of one dataset with the functions that change them; see register-pairs.js. */
export interface PairEditor {
  values: PairValues;
  set: (changes: Partial<PairValues>) => void;
  put: (pairs: PointPair[], more?: Partial<PairValues>) => void;
  place: (side: Side, point: Point, landmark?: string | null, number?: number | null) => void;
  choose: (number: number | null, side?: Side) => void;
  leaveOut: (number: number) => void;
  exchange: (a: number, b: number) => void;
  undo: () => void;
  canUndo: () => boolean;
}

export type Child = Node | string | null | undefined | false | Child[];

type EventOn<E extends Event, T> = Omit<E, "target" | "currentTarget"> & {
  target: T;
  currentTarget: T;
};

/** Attributes and listeners of an element; false, null and undefined leave an attribute out. */
export interface Attributes<T> {
  [name: string]: unknown;
  style?: Record<string, string>;
  onclick?: (event: EventOn<MouseEvent, T>) => unknown;
  onchange?: (event: EventOn<Event, T>) => unknown;
  oninput?: (event: EventOn<Event, T>) => unknown;
  onsubmit?: (event: EventOn<SubmitEvent, T>) => unknown;
  ontoggle?: (event: Event) => unknown;
}
