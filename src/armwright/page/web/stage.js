// A 3D view: its light, its camera, which fits a frame and can be turned, and the groups of its parts.

import { $, element } from "./format.js";

const MARGIN = 1.05; // distance of the camera, as a multiple of that at which the sphere around the frame just fits

// Returns an open view in a box, in which `draw` draws again after a reset; null without 3D graphics, as a note then says.
export function openStage(box, names, view, draw, otherwise, prepare = () => {}) {
  try {
    const stage = new Stage(box, names, view);
    prepare(stage.canvas);
    stage.open();
    $("reset").addEventListener("click", () => {
      Object.assign(stage, { frame: null, turned: false });
      draw();
    });
    return stage;
  } catch {
    box.replaceChildren(element("p", { class: "note" }, `This browser shows no 3D graphics (WebGL). ${otherwise}`));
    $("reset").disabled = true;
    return null;
  }
}

class Stage {
  // names: of the groups; view: the initial direction of the camera. Throws without WebGL.
  constructor(box, names, view) {
    this.box = box;
    this.view = view;
    this.frame = null; // { low, high, centre, radius } of what is visible
    this.turned = false; // whether the user has rotated the view
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.canvas = this.renderer.domElement;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.001, 1e5);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8890a0, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(3, -5, 8);
    this.scene.add(sun);
    this.groups = {}; // parts that are redrawn separately
    for (const name of names) {
      this.groups[name] = new THREE.Group();
      this.scene.add(this.groups[name]);
    }
  }

  // Adds the canvas to its box, with orbit controls. Listeners added to the canvas earlier run first.
  open() {
    this.box.append(this.canvas);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.canvas.style.touchAction = "pan-y"; // vertical swipes scroll the page
    this.controls.addEventListener("change", () => this.render());
    this.controls.addEventListener("start", () => { this.turned = true; });
    new ResizeObserver(() => this.fit()).observe(this.box);
    this.fit();
  }

  // Fits the canvas to its box.
  fit() {
    if (!this.box.clientWidth) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(this.box.clientWidth, this.box.clientHeight);
    this.camera.aspect = this.box.clientWidth / this.box.clientHeight;
    this.camera.updateProjectionMatrix();
    if (this.frame === null) this.render();
    else this.look();
  }

  // Moves the camera so that the whole frame is visible, keeping its direction if the user rotated it.
  look() {
    const far = (MARGIN * this.frame.radius) / Math.sin((this.camera.fov * Math.PI) / 360) / Math.min(1, this.camera.aspect);
    const way = this.turned ? this.camera.position.clone().sub(this.controls.target) : new THREE.Vector3(...this.view);
    this.controls.target.set(...this.frame.centre);
    this.camera.position.copy(this.controls.target).addScaledVector(way.normalize(), far);
    this.camera.near = far / 100;
    this.camera.far = 10 * far;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.render();
  }

  // Fits the frame to points unless it holds them with a slack, and they fill this share of it; returns whether it has.
  reframe(points, least, slack, share) {
    const { frame } = this, wanted = frameOf(points, least), more = slack * (frame?.radius ?? 0);
    const holds = frame !== null && wanted.low.every((v, k) => v >= frame.low[k] - more) && wanted.high.every((v, k) => v <= frame.high[k] + more);
    if (holds && wanted.radius > share * frame.radius) return false;
    this.frame = wanted;
    return true;
  }

  render() {
    this.renderer.render(this.scene, this.camera);
  }
}

// The frame of points: { low, high, centre, radius }.
function frameOf(points, least) {
  const low = [0, 1, 2].map((k) => points.reduce((lowest, p) => Math.min(lowest, p[k]), Infinity));
  const high = [0, 1, 2].map((k) => points.reduce((highest, p) => Math.max(highest, p[k]), -Infinity));
  const radius = Math.max(least, Math.hypot(...high.map((v, k) => v - low[k])) / 2);
  return { low, high, centre: low.map((v, k) => (v + high[k]) / 2), radius };
}
