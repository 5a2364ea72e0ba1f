// In how many directions the selected design holds its tool, at the points of a grid: a slice, and bodies in the 3D view.

import { drawCloud } from "./arm.js";
import { listen, state } from "./state.js";
import { $, colour, isTouched, number, onTheme, percent } from "./format.js";

const AXES = ["x", "y", "z"];
const [NO_DIRECTION, ALL] = [1, 255]; // levels of points, see report/page_reach_maps.py
const VIRIDIS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]]; // from the least share to all directions
const BODY = 0.16; // radius of a body in the 3D view, as a share of the grid's spacing

let content = null, at = [null, null, null]; // index of the slice across each axis

export function openReach(shownContent) {
  content = shownContent;
  for (const id of ["reach-axis", "reach-use", "reach-space"]) $(id).addEventListener("change", drawReach);
  $("reach-at").addEventListener("input", () => {
    at[Number($("reach-axis").value)] = Number($("reach-at").value);
    drawReach();
  });
  listen((changed) => { if (changed.has("design")) drawReach(); });
  onTheme(drawReach);
  drawReach();
}

export function drawReach() {
  const map = content.reach[state.design];
  $("reach-box").hidden = map === undefined;
  if (map === undefined) {
    drawCloud(null);
    return;
  }
  const axis = Number($("reach-axis").value), n = map.shape[axis];
  at[axis] = Math.min(at[axis] ?? nearestToBase(map, axis), n - 1);
  $("reach-at").max = n - 1;
  $("reach-at").value = at[axis];
  $("reach-value").textContent = `${AXES[axis]} = ${coordinate(map, axis, at[axis]).toFixed(3)} m`;
  $("reach-use-label").hidden = map.conditions === "";
  $("reach-use-label").querySelector("span").textContent = map.conditions;
  $("reach-box").querySelector("h2").textContent = `Reach map: #${state.design}`;
  drawSlice(map, axis);
  drawCloud($("reach-space").checked ? bodies(map, axis) : null);
}

const coordinate = (map, axis, index) => map.low[axis] + index * map.spacing;

function nearestToBase(map, axis) {
  const index = Math.round((content.arm(state.design).base[axis] - map.low[axis]) / map.spacing);
  return Math.min(Math.max(index, 0), map.shape[axis] - 1);
}

// The level of a point by its indices along x, y and z.
function level(map, [x, y, z]) {
  const [, ny, nz] = map.shape, isUse = map.conditions !== "" && $("reach-use").checked;
  return map.levels[(isUse ? map.levels.length / 2 : 0) + (x * ny + y) * nz + z];
}

const share = (found) => (found - NO_DIRECTION) / (ALL - NO_DIRECTION);

// Red, green and blue of a level, 0 to 255.
function paint(found) {
  if (found <= NO_DIRECTION) return [190, 190, 198];
  const place = share(found) * (VIRIDIS.length - 1), below = Math.min(Math.floor(place), VIRIDIS.length - 2);
  return VIRIDIS[below].map((v, k) => Math.round(v + (place - below) * (VIRIDIS[below + 1][k] - v)));
}

function describe(found) {
  if (found === 0) return "not reached";
  return found === NO_DIRECTION ? "reached, in none of the directions" : `${percent(share(found), 0)} of the directions`;
}

function drawSlice(map, axis) {
  const [right, up] = [0, 1, 2].filter((k) => k !== axis), [wide, high] = [map.shape[right], map.shape[up]];
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [wide, high];
  const brush = canvas.getContext("2d"), pixels = brush.createImageData(wide, high), points = { x: [], y: [], text: [] };
  for (let i = 0; i < wide; i++) {
    for (let j = 0; j < high; j++) {
      const place = [];
      [place[axis], place[right], place[up]] = [at[axis], i, j];
      const found = level(map, place);
      if (found > 0) pixels.data.set([...paint(found), 255], 4 * ((high - 1 - j) * wide + i));
      points.x.push(coordinate(map, right, i));
      points.y.push(coordinate(map, up, j));
      points.text.push(describe(found));
    }
  }
  brush.putImageData(pixels, 0, 0);
  const half = map.spacing / 2, here = coordinate(map, axis, at[axis]);
  const low = [right, up].map((k) => map.low[k] - half), size = [wide * map.spacing, high * map.spacing];
  const near = content.targets.filter((target) => Math.abs(target[axis] - here) <= half);
  const { base } = content.arm(state.design);
  const marks = (places, name, marker) => ({
    x: places.map((p) => p[right]), y: places.map((p) => p[up]), mode: "markers", name, marker, hoverinfo: "name",
  });
  const scale = VIRIDIS.map((rgb, k) => [k / (VIRIDIS.length - 1), `rgb(${rgb})`]);
  const traces = [
    { ...points, mode: "markers", hovertemplate: `${AXES[right]} %{x:.3f}, ${AXES[up]} %{y:.3f} m: %{text}<extra></extra>`, showlegend: false,
      marker: { opacity: 0, size: 8, color: points.x.map(() => 0), cmin: 0, cmax: 100, colorscale: scale, showscale: true,
        colorbar: { title: { text: "directions [%]", side: "right" }, thickness: 12, outlinewidth: 0 } } },
    marks([base], "base", { color: colour("ink"), size: 10, symbol: "triangle-up" }),
    marks(near, "targets in the slice", { color: content.head.colours.target, size: 9, line: { color: colour("paper"), width: 1 } }),
  ];
  const edge = { gridcolor: colour("grid"), zeroline: false, linecolor: colour("line"), showline: true, constrain: "domain" };
  const layout = {
    images: [{ source: canvas.toDataURL(), xref: "x", yref: "y", x: low[0], y: low[1] + size[1], sizex: size[0], sizey: size[1], sizing: "stretch", layer: "below" }],
    xaxis: { ...edge, title: { text: `${AXES[right]} [m]`, standoff: 6 }, range: [low[0], low[0] + size[0]] },
    yaxis: { ...edge, title: { text: `${AXES[up]} [m]`, standoff: 8 }, range: [low[1], low[1] + size[1]], scaleanchor: "x" },
    margin: { l: 58, r: 12, t: 8, b: 42 }, legend: { orientation: "h", y: -0.16, font: { size: 12 } }, hovermode: "closest",
    dragmode: isTouched() ? false : "pan", paper_bgcolor: "transparent", plot_bgcolor: "transparent", font: { color: colour("ink"), size: 13 },
  };
  Plotly.react($("reach"), traces, layout, { displaylogo: false, responsive: true, displayModeBar: false });
  const counts = [0, 0]; // of the whole grid: reached, and in all directions
  for (let i = 0; i < map.shape[0]; i++) {
    for (let j = 0; j < map.shape[1]; j++) {
      for (let k = 0; k < map.shape[2]; k++) {
        const found = level(map, [i, j, k]);
        counts[0] += found > 0;
        counts[1] += found === ALL;
      }
    }
  }
  const volume = (count) => `${number(count * map.spacing ** 3, 3)} m³`;
  $("reach-note").textContent = `Share of ${map.about} in which the tool can point, at points ${number(map.spacing, 3)} m apart; grey: reached, in none of `
    + `them. Reached: ${volume(counts[0])}, in all of them ${volume(counts[1])}. The 3D view shows the points up to the slice.`;
}

// The reached points up to the slice.
function bodies(map, axis) {
  const places = [], colours = [];
  for (let i = 0; i < map.shape[0]; i++) {
    for (let j = 0; j < map.shape[1]; j++) {
      for (let k = 0; k < map.shape[2]; k++) {
        const place = [i, j, k], found = level(map, place);
        if (found === 0 || place[axis] > at[axis]) continue;
        places.push(place.map((index, way) => coordinate(map, way, index)));
        colours.push(paint(found).map((v) => v / 255));
      }
    }
  }
  return { places, colours, radius: BODY * map.spacing };
}
