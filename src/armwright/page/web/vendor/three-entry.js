export {
  BufferGeometry, CanvasTexture, CylinderGeometry, DirectionalLight, Float32BufferAttribute, Group, HemisphereLight,
  LineBasicMaterial, LineDashedMaterial, LineSegments, Mesh, MeshLambertMaterial, PerspectiveCamera, Scene,
  SphereGeometry, Sprite, SpriteMaterial, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
