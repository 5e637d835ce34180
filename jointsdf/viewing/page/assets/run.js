// The page of runs of one shape: ground truth and fits side by side.

import * as THREE from "three";
import { pageData, unpack, digits } from "page/data.js";
import { Surface } from "page/surface.js";
import { FieldGrid } from "page/plane.js";
import { Views } from "page/views.js";
import { Colouring } from "page/colouring.js";
import { PartTable } from "page/parts.js";
import { reading } from "page/reading.js";

const data = pageData();
const byId = (id) => document.getElementById(id);
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const middle = data.middle;
const cut = new THREE.Plane(new THREE.Vector3(0, 0, -1), 0);

function makeMaterials() {
  const shared = { clippingPlanes: [], side: THREE.DoubleSide };
  const lines = { clippingPlanes: shared.clippingPlanes, transparent: true };
  return {
    cuts: shared.clippingPlanes,
    surface: new THREE.MeshLambertMaterial({ ...shared, vertexColors: true, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }),
    points: new THREE.PointsMaterial({ ...shared, vertexColors: true, size: 3, sizeAttenuation: false }),
    wire: new THREE.MeshBasicMaterial({ ...lines, wireframe: true, opacity: 0.35, visible: false }),
    crease: new THREE.LineBasicMaterial({ ...lines, opacity: 0.9 }),
  };
}

async function load() {
  const materials = makeMaterials();
  const panels = [...document.querySelectorAll(".panel")];
  const views = new Views(byId("views"), byId("canvas"), panels, data.radius, data.up);
  const surfaces = [];
  const grids = [];
  for (const [k, packed] of data.surfaces.entries()) {
    const surface = new Surface(packed, await unpack(packed.arrays), data.parts, middle, k + 1, materials);
    surfaces.push(surface);
    views.scene.add(surface.group);
    if (!packed.field) continue;
    const grid = new FieldGrid(packed.field, await unpack(packed.field.arrays), new THREE.Vector3(...middle));
    grids.push(grid);
    views.scene.add(grid.sheet(data.spacing, k + 1, { ink: new THREE.Color(), inside: new THREE.Color(), outside: new THREE.Color() }));
  }
  return { views, surfaces, grids, materials };
}

// Colours of lines and of the sheet by the system's preference for light or dark.
function followScheme({ views, grids, materials }) {
  const apply = () => {
    const colour = (name) => new THREE.Color(style(name));
    materials.wire.color = colour("--ink");
    materials.crease.color = colour("--ink");
    for (const { mesh } of grids) {
      for (const [name, from] of [["ink", "--ink"], ["inside", "--inside"], ["outside", "--outside"]]) mesh.material.uniforms[name].value.copy(colour(from)).convertLinearToSRGB();
    }
    views.request();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
  apply();
}

function wirePlane({ views, grids, materials }) {
  const [axis, place, flip, text] = ["plane-axis", "plane-place", "plane-flip", "plane-text"].map(byId);
  const update = () => {
    const on = axis.value !== "none";
    place.disabled = flip.disabled = !on;
    materials.cuts.length = 0;
    grids.forEach(({ mesh }) => { mesh.visible = on; });
    text.textContent = "";
    if (on) {
      const k = "xyz".indexOf(axis.value);
      const half = (data.box.high[k] - data.box.low[k]) / 2;
      const along = (data.box.high[k] + data.box.low[k]) / 2 - middle[k] + Number(place.value) * half * 1.05;
      const away = views.direction.getComponent(k) < 0 ? 1 : -1; // the section faces the first view
      const side = flip.checked ? -away : away;
      cut.normal.set(0, 0, 0).setComponent(k, side);
      cut.constant = -side * along;
      materials.cuts.push(cut);
      grids.forEach((grid) => grid.move(k, along));
      text.textContent = `${axis.value} = ${digits(along + middle[k], 4)} ${data.unit}`;
    }
    views.request();
  };
  [axis, place, flip].forEach((control) => control.addEventListener("input", update));
  update();
}

function wireLooks({ views, surfaces, materials }) {
  byId("wireframe").addEventListener("change", (event) => { materials.wire.visible = event.target.checked; views.request(); });
  byId("creases").addEventListener("change", (event) => { materials.crease.visible = event.target.checked; views.request(); });
  byId("explode").addEventListener("input", (event) => {
    const pieces = surfaces.flatMap((surface) => surface.pieces);
    for (const { object, middle: from } of pieces) object.position.copy(from).multiplyScalar(Number(event.target.value));
    views.request();
  });
  byId("reset").addEventListener("click", () => views.reset());
  byId("views").addEventListener("keydown", (event) => {
    const action = { "+": () => views.zoom(1.2), "=": () => views.zoom(1.2), "-": () => views.zoom(1 / 1.2), 0: () => views.reset() }[event.key];
    if (action) { action(); event.preventDefault(); }
  });
}

// Hovering shows what is under the pointer; a click (or tap) picks its part as well, and says it.
function wirePicking({ views, surfaces, grids }, colouring, table) {
  const tip = byId("tip");
  const objects = () => [
    ...surfaces.flatMap((surface) => surface.pieces.map((piece) => piece.object)),
    ...grids.map((grid) => grid.mesh),
  ].filter((object) => object.visible);
  const kept = (point) => !byId("plane-place").disabled ? cut.distanceToPoint(point) >= 0 : true;
  const find = (event) => {
    const hit = views.pick(event, objects(), kept);
    return hit && reading(hit, data, colouring);
  };
  let waiting = null;
  let down = null;
  byId("views").addEventListener("pointermove", (event) => {
    if (event.buttons) { tip.hidden = true; return; }
    if (!waiting) requestAnimationFrame(() => {
      const found = find(waiting);
      tip.hidden = !found;
      if (found) {
        const box = byId("views").getBoundingClientRect();
        tip.textContent = found.lines.join("\n");
        const right = waiting.clientX - box.left > box.width / 2;
        tip.style.transform = `translate(${waiting.clientX - box.left + (right ? -16 : 16)}px, ${waiting.clientY - box.top + 12}px) translateX(${right ? -100 : 0}%)`;
      }
      waiting = null;
    });
    waiting = event;
  });
  byId("views").addEventListener("pointerleave", () => { tip.hidden = true; });
  byId("views").addEventListener("pointerdown", (event) => { down = event; });
  byId("views").addEventListener("pointerup", (event) => {
    if (!down || Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) > 4) return;
    const found = find(event);
    table.pick(found ? found.part : null);
    byId("readout").textContent = found ? found.lines.join(" \u00b7 ") : "Nothing there.";
  });
}

async function start() {
  const shown = await load();
  const colouring = new Colouring(data, shown.surfaces, () => shown.views.request());
  const table = new PartTable(data, shown.surfaces, colouring, () => shown.views.request());
  followScheme(shown);
  wirePlane(shown);
  wireLooks(shown);
  wirePicking(shown, colouring, table);
  document.body.dataset.state = "ready";
  shown.views.draw();
}

start().catch((error) => {
  byId("readout").textContent = `The 3D view cannot be shown: ${error.message}`;
  document.body.dataset.state = "failed";
  console.error(error);
});
