// Following of one job until it ends.
import { get } from "./api.js";

/** @import { Job } from "./types.js" */

const PAUSE = 400; // between two requests [ms]

/**
 * Follow a job and return it once it has ended.
 * @param {Job} job
 * @param {(job: Job) => boolean} changed called with each state; false ends the following
 * @returns {Promise<Job>}
 */
export async function watchJob(job, changed) {
  let now = job;
  while (changed(now) && (now.state === "queued" || now.state === "running")) {
    await new Promise((done) => setTimeout(done, PAUSE));
    now = await get(`/jobs/${job.id}`);
  }
  return now;
}
