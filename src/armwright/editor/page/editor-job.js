// The search that the page has started.

import { ask, complain, design, opened } from "./editor-document.js";
import { $, duration } from "./format.js";
import { request } from "./key.js";

const EVERY = 500; // [ms] between two questions
const LEAST = 5; // [s] of a budget

export function openJob() {
  $("run").addEventListener("click", start);
  $("budget").addEventListener("keydown", (event) => {
    if (event.key === "Enter") start();
  });
  $("job-stop").addEventListener("click", () => ask("stop", {}).catch((fault) => complain(fault.message)));
  look();
}

async function start() {
  const seconds = Number($("budget").value);
  if (!(seconds >= LEAST)) {
    complain(`Budget: expected at least ${LEAST} seconds, got “${$("budget").value}”.`);
    return;
  }
  if (opened.assessed.errors.length) {
    complain(`No search can start yet: ${opened.assessed.errors[0]}`);
    return;
  }
  await design(seconds);
  await look();
}

// Shows the state of the search, again and again while it runs.
async function look() {
  let job = null;
  try {
    job = await (await request("job")).json();
  } catch (fault) {
    if (fault.status) complain(fault.message);
    setTimeout(look, 4 * EVERY);
    return;
  }
  $("job").hidden = job === null;
  if (job === null) return;
  $("job-state").textContent = state(job);
  $("job-progress").hidden = !job.running;
  $("job-progress").max = job.seconds;
  $("job-progress").value = job.elapsed;
  $("job-stop").hidden = !job.running;
  $("job-page").href = job.report;
  $("job-page").hidden = job.running || job.exit_code !== 0;
  $("run").disabled = job.running;
  const output = $("job-output"), isAtEnd = output.scrollHeight - output.scrollTop - output.clientHeight < 40;
  output.textContent = job.lines.join("\n");
  if (isAtEnd) output.scrollTop = output.scrollHeight;
  if (job.running) setTimeout(look, EVERY);
  else if (job.exit_code) $("job-details").open = true;
}

function state({ running, exit_code, folder, elapsed, lines }) {
  if (running) return `Designing arms into ${folder}, for ${duration(elapsed)}: ${lines.at(-1) ?? "starting"}`;
  if (exit_code === 0) return `Finished: ${folder}`;
  if (exit_code === 130) return `Stopped; repeat the command in the terminal to go on: ${folder}`;
  return `Failed with exit code ${exit_code}: ${lines.at(-1) ?? ""}`;
}
