// All forms below the scene: each shows what the files hold, and changes them.

import { drawCycle, openCycle } from "./editor-cycle.js";
import { opened } from "./editor-document.js";
import { drawLoad, drawObstacles, openObstacles } from "./editor-bodies.js";
import { drawMotors, drawSpace, openMotors } from "./editor-space.js";
import { drawTargets, openTargets } from "./editor-targets.js";
import { drawWants, openWants } from "./editor-wants.js";
import { $ } from "./format.js";

export function openForms(choices) {
  openTargets(choices);
  openCycle();
  openObstacles();
  openWants(choices);
  openMotors(choices);
  $("unit").addEventListener("change", drawForms);
}

export function drawForms() {
  if (opened.assessed.task !== null) {
    drawTargets();
    drawCycle();
    drawLoad();
    drawObstacles();
    drawWants();
  }
  if (opened.assessed.space !== null) {
    drawSpace();
    drawMotors();
  }
}
