// The reach map of the selected design, by slices.

import { listen, state } from "./state.js";
import { axis as plotAxis, plot } from "./plot.js";
import { $, colour, number, onTheme, percent } from "./format.js";

const AXES = ["x", "y", "z"];
const [NO_DIRECTION, ALL] = [1, 255]; // levels of points, see page/reach_maps.py
const VIRIDIS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]]; // from the least share to all directions
const GREY = [190, 190, 198]; // of points that are reached in none of the directions

let content = null;
let design = null, at = [null, null, null]; // index of the slice along each axis, for this design

export function openReach(shownContent) {
  content = shownContent;
  for (const id of ["reach-axis", "reach-use"]) $(id).addEventListener("change", drawReach);
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
  if (map === undefined) return;
  if (design !== state.design) [design, at] = [state.design, [null, null, null]];
  const axis = Number($("reach-axis").value), n = map.shape[axis];
  at[axis] = Math.min(at[axis] ?? nearestToBase(map, axis), n - 1);
  $("reach-at").max = n - 1;
  $("reach-at").value = at[axis];
  $("reach-value").textContent = `${AXES[axis]} = ${coordinate(map, axis, at[axis]).toFixed(3)} m`;
  $("reach-use-label").hidden = map.conditions === "";
  $("reach-use-label").querySelector("span").textContent = map.conditions;
  $("reach-box").querySelector("h2").textContent = `Reach map: #${state.design}`;
  const half = map.levels.length / 2, isUse = map.conditions !== "" && $("reach-use").checked;
  const levels = isUse ? map.levels.subarray(half) : map.levels.subarray(0, half);
  drawSlice(map, levels, axis);
  describeVolumes(map, levels);
}

const coordinate = (map, axis, index) => map.low[axis] + index * map.spacing;
const level = (map, levels, [x, y, z]) => levels[(x * map.shape[1] + y) * map.shape[2] + z];
const share = (found) => (found - NO_DIRECTION) / (ALL - NO_DIRECTION);

function nearestToBase(map, axis) {
  const index = Math.round((content.arm(state.design).base[axis] - map.low[axis]) / map.spacing);
  return Math.min(Math.max(index, 0), map.shape[axis] - 1);
}

// Red, green and blue of a level, 0 to 255.
function paint(found) {
  if (found <= NO_DIRECTION) return GREY;
  const place = share(found) * (VIRIDIS.length - 1), below = Math.min(Math.floor(place), VIRIDIS.length - 2);
  return VIRIDIS[below].map((v, k) => Math.round(v + (place - below) * (VIRIDIS[below + 1][k] - v)));
}

function describe(found) {
  if (found === 0) return "not reached";
  if (found === NO_DIRECTION) return "reached, but in none of the directions";
  return `${share(found) < 0.01 ? "less than 1 %" : found < ALL && share(found) > 0.99 ? "more than 99 %" : percent(share(found), 0)} of the directions`;
}

// The cells of the slice as an image, and its points with what they say.
function raster(map, levels, axis, [right, up]) {
  const [wide, high] = [map.shape[right], map.shape[up]], canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [wide, high];
  const brush = canvas.getContext("2d"), pixels = brush.createImageData(wide, high), points = { x: [], y: [], text: [] };
  for (let i = 0; i < wide; i++) {
    for (let j = 0; j < high; j++) {
      const place = [];
      [place[axis], place[right], place[up]] = [at[axis], i, j];
      const found = level(map, levels, place);
      if (found > 0) pixels.data.set([...paint(found), 255], 4 * ((high - 1 - j) * wide + i));
      points.x.push(coordinate(map, right, i));
      points.y.push(coordinate(map, up, j));
      points.text.push(describe(found));
    }
  }
  brush.putImageData(pixels, 0, 0);
  return { image: canvas.toDataURL(), points };
}

function drawSlice(map, levels, axis) {
  const plane = [0, 1, 2].filter((k) => k !== axis), [right, up] = plane, half = map.spacing / 2;
  const { image, points } = raster(map, levels, axis, plane);
  const low = plane.map((k) => map.low[k] - half), size = plane.map((k) => map.shape[k] * map.spacing);
  const near = content.targets.filter((target) => Math.abs(target[axis] - coordinate(map, axis, at[axis])) <= half);
  const marks = (places, name, marker) => ({
    x: places.map((p) => p[right]), y: places.map((p) => p[up]), mode: "markers", name, marker, hoverinfo: "name",
  });
  const scale = VIRIDIS.map((rgb, k) => [k / (VIRIDIS.length - 1), `rgb(${rgb})`]);
  const traces = [
    { ...points, mode: "markers", hovertemplate: `${AXES[right]} %{x:.3f}, ${AXES[up]} %{y:.3f} m: %{text}<extra></extra>`, showlegend: false,
      marker: { opacity: 0, size: 8, color: points.x.map(() => 0), cmin: 0, cmax: 100, colorscale: scale, showscale: true,
        colorbar: { title: { text: "directions [%]", side: "right" }, thickness: 12, outlinewidth: 0 } } },
    marks([content.arm(state.design).base], "base", { color: colour("ink"), size: 10, symbol: "triangle-up" }),
    marks(near, "targets in the slice", { color: content.head.colours.target, size: 9, line: { color: colour("paper"), width: 1 } }),
  ];
  const layout = {
    images: [{ source: image, xref: "x", yref: "y", x: low[0], y: low[1] + size[1], sizex: size[0], sizey: size[1], sizing: "stretch", layer: "below" }],
    xaxis: plotAxis(`${AXES[right]} [m]`, { range: [low[0], low[0] + size[0]], constrain: "domain" }),
    yaxis: plotAxis(`${AXES[up]} [m]`, { range: [low[1], low[1] + size[1]], constrain: "domain", scaleanchor: "x" }),
    legend: { orientation: "h", y: -0.16, font: { size: 12 } },
  };
  plot("reach", traces, layout);
}

function describeVolumes(map, levels) {
  const volume = (isCounted) => `${number(levels.reduce((n, found) => n + isCounted(found), 0) * map.spacing ** 3, 3)} m³`;
  $("reach-note").textContent = `Colours show the share of the tool's directions that are reached: ${map.directions}, at points ${number(map.spacing, 3)} m `
    + `apart. Grey: reached, but in none of these directions. Volume reached: ${volume((found) => found > 0)}; in all directions: `
    + `${volume((found) => found === ALL)}.`;
}
