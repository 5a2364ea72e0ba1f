// Opens the page with its embedded content or with that of its server.

import { drawArm, drawn, openArm, snapshot } from "./arm.js";
import { Content, embedded } from "./content.js";
import { drawCurve, openCurve } from "./curve.js";
import { during } from "./cycle.js";
import { drawDesign, openDesign, postures } from "./design.js";
import { drawExisting, openExisting } from "./existing.js";
import { drawConfiguration, drawHeader, openHeader } from "./header.js";
import { fileFetcher, openLive } from "./live.js";
import { drawLoads, openLoads } from "./loads.js";
import { growPareto, openPareto } from "./pareto.js";
import { drawPick, openPick, ranked } from "./pick.js";
import { arrange, drawRecommended, openRecommended } from "./recommended.js";
import { fromAddress, keepAddress, set, state } from "./state.js";
import { drawTable, openTable } from "./table.js";
import { drawTranscript, openTranscript } from "./transcript.js";
import { $ } from "./format.js";

const content = new Content();
let isOpen = false;

// Selects the design of the address, or else the knee of the front, or the nearest to a feasible one.
function begin() {
  const selected = fromAddress(content);
  if (selected.design === undefined) selected.design = ranked(content, content.head.front)[0] ?? content.head.nothing?.nearest ?? (content.n ? 0 : null);
  set(selected);
}

function open() {
  const { task, seed } = content.head.config;
  isOpen = true;
  if ($("content")) document.title = `${task.name}, seed ${seed}: armwright`;
  arrange(content.head);
  openHeader(content);
  openCurve(content);
  openDesign(content, fileFetcher(content));
  openExisting(content);
  openPareto(content);
  openTable(content);
  openPick(content);
  openTranscript(content);
  keepAddress();
  begin();
  openArm(content);
  openRecommended(content);
  openLoads(content);
  drawConfiguration();
  addEventListener("hashchange", () => set(fromAddress(content)));
  $("loading").hidden = true;
}

// Redraws the page after content was added.
function grow() {
  drawHeader();
  drawCurve();
  growPareto();
  drawTable();
  drawPick();
  drawTranscript();
  drawConfiguration();
  drawExisting();
}

function take(buffer) {
  const before = content.head?.result.finished;
  content.load(buffer);
  if (content.n === 0) return;
  if (!isOpen) {
    open();
    return;
  }
  grow();
  if (content.head.result.finished !== before) {
    drawRecommended();
    drawLoads();
    drawDesign();
    drawArm();
  }
}

async function start() {
  const data = $("content");
  try {
    if (data) take(await embedded(data.textContent));
    else openLive(content, take);
  } catch (fault) {
    $("loading").textContent = `This page cannot be shown: ${fault.message}`;
    throw fault;
  }
  if (data && content.n === 0) $("loading").textContent = "The run has no finished design yet.";
}

// For the console and for tests.
window.armwright = { content, state, set, postures, during, drawn, drawArm, snapshot };
start();
