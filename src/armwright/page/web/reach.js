// The reach map of the selected design: a slice, and points in the 3D view.

import { drawCloud } from "./arm.js";
import { listen, state } from "./state.js";
import { $, colour, isTouched, number, onTheme, percent } from "./format.js";

const AXES = ["x", "y", "z"];
const [NO_DIRECTION, ALL] = [1, 255]; // levels of points, see page/reach_maps.py
const VIRIDIS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]]; // from the least share to all directions
const GREY = [190, 190, 198]; // of points that are reached in none of the directions
const POINT = 0.16; // radius of a point in the 3D view, as a share of the grid's spacing

let content = null;
let design = null, at = [null, null, null]; // index of the slice along each axis, for this design

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
  drawCloud($("reach-space").checked ? pointsUpToSlice(map, levels, axis) : null);
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
  const edge = { gridcolor: colour("grid"), zeroline: false, linecolor: colour("line"), showline: true, constrain: "domain" };
  const layout = {
    images: [{ source: image, xref: "x", yref: "y", x: low[0], y: low[1] + size[1], sizex: size[0], sizey: size[1], sizing: "stretch", layer: "below" }],
    xaxis: { ...edge, title: { text: `${AXES[right]} [m]`, standoff: 6 }, range: [low[0], low[0] + size[0]] },
    yaxis: { ...edge, title: { text: `${AXES[up]} [m]`, standoff: 8 }, range: [low[1], low[1] + size[1]], scaleanchor: "x" },
    margin: { l: 58, r: 12, t: 8, b: 42 }, legend: { orientation: "h", y: -0.16, font: { size: 12 } }, hovermode: "closest",
    dragmode: isTouched() ? false : "pan", paper_bgcolor: "transparent", plot_bgcolor: "transparent", font: { color: colour("ink"), size: 13 },
  };
  Plotly.react($("reach"), traces, layout, { displaylogo: false, responsive: true, displayModeBar: false });
}

function describeVolumes(map, levels) {
  const volume = (isCounted) => `${number(levels.reduce((n, found) => n + isCounted(found), 0) * map.spacing ** 3, 3)} m³`;
  const upTo = $("reach-space").checked ? " The 3D view shows the points up to the slice." : "";
  $("reach-note").textContent = `Colours show the share of the tool's directions that are reached: ${map.directions}, at points ${number(map.spacing, 3)} m `
    + `apart. Grey: reached, but in none of these directions. Volume reached: ${volume((found) => found > 0)}; in all directions: `
    + `${volume((found) => found === ALL)}.${upTo}`;
}

// The reached points up to the slice, and the corners of the whole grid.
function pointsUpToSlice(map, levels, axis) {
  const points = [], colours = [], [nx, ny, nz] = map.shape;
  for (let i = 0; i < nx; i++) {
    for (let j = 0; j < ny; j++) {
      for (let k = 0; k < nz; k++) {
        const place = [i, j, k], found = level(map, levels, place);
        if (found === 0 || place[axis] > at[axis]) continue;
        points.push(place.map((index, way) => coordinate(map, way, index)));
        colours.push(paint(found).map((v) => v / 255));
      }
    }
  }
  const corners = [map.low, map.low.map((v, k) => v + (map.shape[k] - 1) * map.spacing)];
  return { points, colours, radius: POINT * map.spacing, corners };
}
