// The page of a run in progress: fetches new content from its server, and sends requests of the user.

import { $, duration, element, plural } from "./format.js";
import { openKey, post, request } from "./key.js";

const LOOK = 500, AGAIN = 1000; // [ms] between two looks at the status, and between attempts to reach a lost server

let content = null;
let take = null;
let status = null;
let version = 0; // of the content that the page shows
let busy = false, lost = false;

// Fetches the file of a design that the page does not hold; null offline.
export function fileFetcher() {
  if ($("content")) return null;
  return async (design, format) => (await request(`file?design=${design}&format=${format}`)).text();
}

export function openLive(shownContent, taken) {
  [content, take] = [shownContent, taken];
  openKey();
  $("live").hidden = false;
  $("loading").textContent = "The first designs are being evaluated …";
  $("stop").addEventListener("click", stop);
  follow();
  setInterval(show, 1000); // updates the elapsed seconds
}

// Follows the status while the tab is visible.
async function follow() {
  for (;;) {
    try {
      if (!document.hidden) {
        const news = await (await request("status")).json();
        queueMicrotask(() => takeStatus(news)); // so that no fault of the page is taken for a lost connection
      }
    } catch (fault) {
      if (fault.status === 403) {
        $("loading").textContent = `This page cannot be shown: ${fault.message}`;
        complain("refusal", fault.message);
        return;
      }
      lost = true;
      show();
    }
    await new Promise((next) => setTimeout(next, lost ? AGAIN : LOOK));
  }
}

function takeStatus(news) {
  lost = false;
  const before = status;
  status = news;
  if (before?.designs && before.run !== status.run) { // another run in this folder
    location.reload();
    return;
  }
  document.title = `${status.name}: armwright, live`;
  show();
  if (status.version !== version && (status.designs || content.n)) catchUp(status.version);
}

// Fetches the run; a later look at the status tries again if that fails.
async function catchUp(latest) {
  if (busy) return;
  busy = true;
  const news = await request("run").then((reply) => reply.arrayBuffer()).catch(() => null);
  busy = false;
  if (news === null) return;
  version = latest;
  take(news);
}

async function stop() {
  try {
    await post("control", { action: "stop" });
    complain("refusal", "");
  } catch (fault) {
    complain("refusal", fault.status ? `Refused: ${fault.message}` : "The request did not reach the server.");
  }
}

function complain(id, message) {
  $(id).hidden = message === "";
  $(id).textContent = message;
}

const since = () => duration(Math.max(0, Date.now() / 1000 - status.since));

function doing() {
  switch (status.doing) {
    case "asking": return `asking the ${status.asks_a_model ? "model" : "proposer"}, ${since()}`;
    case "evaluating":
      return status.designs < status.planned ? `evaluating ${status.designs + 1} of ${status.planned}` : "writing the results";
    case "stopped": return `stopped at ${status.designs} of ${status.planned}; repeat the command to resume`;
    case "searching": return "searching; its designs appear when the search ends";
    case "finished": return `finished: ${plural(status.designs, "design")}`;
    default: return `not running, at ${status.designs}${status.planned ? ` of ${status.planned}` : ""}`;
  }
}

function show() {
  const isOver = lost || !["asking", "evaluating"].includes(status?.doing);
  if (lost && status?.doing !== "finished") $("doing").textContent = "Connection lost; trying again …";
  else if (status !== null) $("doing").textContent = doing();
  if (status === null) return;
  $("progress").hidden = !status.planned;
  $("progress").max = status.planned || 1;
  $("progress").value = status.designs;
  $("left").textContent = isOver || status.left === null || status.left < 1 ? "" : `about ${duration(status.left)} left`;
  $("stop").hidden = !lost && isOver;
  $("stop").disabled = lost;
  complain("fault", status.fault ? `last fault: ${status.fault}` : "");
}
