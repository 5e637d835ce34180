// Panels with one camera: a canvas behind them, of which each panel is a part. Draws on demand.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const DIRECTION = new THREE.Vector3(-0.55, -0.7, 0.5); // from the middle to the viewer, z up
const HEADLIGHT = new THREE.Vector3(-0.35, 0.5, 1); // in the camera's frame

export class Views {
  // `panels` are the elements over the canvas, panel k showing layer k + 1; `radius` is that of what is shown.
  constructor(container, canvas, panels, radius, up) {
    Object.assign(this, { container, panels, radius, scene: new THREE.Scene(), direction: DIRECTION.clone().normalize() });
    if (up === "y") this.direction.set(this.direction.x, this.direction.z, -this.direction.y);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true }); // kept for print
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.localClippingEnabled = true;
    this.camera = new THREE.OrthographicCamera();
    this.camera.up.set(0, up === "y" ? 1 : 0, up === "y" ? 0 : 1);
    this.light = new THREE.DirectionalLight(0xffffff, 0.42 * Math.PI);
    this.scene.add(this.light, this.light.target, new THREE.AmbientLight(0xffffff, 0.62 * Math.PI));
    this.scene.children.forEach((light) => light.layers.enableAll());
    this.controls = new OrbitControls(this.camera, container);
    this.controls.listenToKeyEvents(container);
    this.controls.addEventListener("change", () => this.request());
    new ResizeObserver(() => this.request()).observe(container);
    this.reset();
  }

  reset() {
    this.camera.position.copy(this.direction).multiplyScalar(4 * this.radius);
    this.camera.zoom = 1;
    this.controls.target.set(0, 0, 0);
    Object.assign(this.camera, { near: 0.1 * this.radius, far: 12 * this.radius });
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.request();
  }

  zoom(factor) {
    this.camera.zoom = Math.min(Math.max(this.camera.zoom * factor, 0.2), 200);
    this.camera.updateProjectionMatrix();
    this.request();
  }

  request() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = 0;
      this.draw();
    });
  }

  draw() {
    const whole = this.container.getBoundingClientRect();
    this.renderer.setScissorTest(false);
    this.renderer.setSize(whole.width, whole.height, false);
    this.renderer.setClearAlpha(0);
    this.renderer.clear();
    this.renderer.setScissorTest(true);
    this.light.position.copy(HEADLIGHT).applyQuaternion(this.camera.quaternion);
    this.panels.forEach((panel, k) => {
      const box = panel.getBoundingClientRect();
      const place = [box.left - whole.left, whole.bottom - box.bottom, box.width, box.height];
      this.renderer.setViewport(...place);
      this.renderer.setScissor(...place);
      this.frame(box);
      this.camera.layers.set(k + 1);
      this.renderer.render(this.scene, this.camera);
    });
  }

  // Fit the frustum to a panel: nearly the whole sphere about the shape is seen at zoom 1.
  frame(box) {
    const half = 0.95 * this.radius;
    const wide = box.width / box.height;
    const [right, top] = wide > 1 ? [half * wide, half] : [half, half / wide];
    Object.assign(this.camera, { left: -right, right, bottom: -top, top });
    this.camera.updateProjectionMatrix();
  }

  // The first thing under the pointer that is not cut away: {panel, object, point, face, index}, or null.
  pick(event, objects, kept) {
    const panel = this.panels.findIndex((element) => {
      const box = element.getBoundingClientRect();
      return event.clientX >= box.left && event.clientX < box.right && event.clientY >= box.top && event.clientY < box.bottom;
    });
    if (panel < 0) return null;
    const box = this.panels[panel].getBoundingClientRect();
    const place = [(2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height];
    this.frame(box);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(...place), this.camera);
    ray.layers.set(panel + 1);
    ray.params.Points.threshold = 0.008 * this.radius;
    const hit = ray.intersectObjects(objects).find((found) => found.object.userData.grid?.covers(found.point) ?? kept(found.point));
    return hit ? { panel, object: hit.object, point: hit.point, face: hit.faceIndex ?? null, index: hit.index ?? null } : null;
  }
}
