// Opens the page with its embedded content.

import { drawArm, drawn, openArm, snapshot } from "./arm.js";
import { Content, embedded } from "./content.js";
import { openCurve } from "./curve.js";
import { during } from "./cycle.js";
import { openDesign, postures } from "./design.js";
import { openExisting } from "./existing.js";
import { drawConfiguration, openHeader } from "./header.js";
import { openLoads } from "./loads.js";
import { openPareto } from "./pareto.js";
import { openPick, ranked } from "./pick.js";
import { arrange, openRecommended } from "./recommended.js";
import { fromAddress, keepAddress, set, state } from "./state.js";
import { openTable } from "./table.js";
import { openTranscript } from "./transcript.js";
import { $ } from "./format.js";

const content = new Content();

// Selects the design of the address, or else the knee of the front, or the nearest to a feasible one.
function begin() {
  const selected = fromAddress(content);
  if (selected.design === undefined) selected.design = ranked(content, content.head.front)[0] ?? content.head.nothing?.nearest ?? (content.n ? 0 : null);
  set(selected);
}

function open() {
  const { task, seed } = content.head.config;
  document.title = `${task.name}, seed ${seed}: armwright`;
  arrange(content.head);
  openHeader(content);
  openCurve(content);
  openDesign(content);
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

async function start() {
  try {
    content.load(await embedded($("content").textContent));
    if (content.n) open();
    else $("loading").textContent = "The run has no finished design yet.";
  } catch (fault) {
    $("loading").textContent = `This page cannot be shown: ${fault.message}`;
    throw fault;
  }
}

// For the console and for tests.
window.armwright = { content, state, set, postures, during, drawn, drawArm, snapshot };
start();
