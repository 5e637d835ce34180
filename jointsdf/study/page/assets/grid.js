// Shapes by heads: a cell per shape and head, coloured by a measure, that opens the 3D page of the shape.

import { digits } from "page/data.js";
import { gradient, scaleColour } from "page/colours.js";
import { element } from "page/elements.js";

const byId = (id) => document.getElementById(id);
const present = (value) => value !== null && value !== undefined;

// Mean over the seeds of a shape and head; null where no run has the number.
function means(runs, shape, column, measure) {
  const values = runs.filter((run) => run.shape === shape && run.column === column).map((run) => run.values[measure]).filter(present);
  return values.length ? values.reduce((sum, value) => sum + value, 0) / values.length : null;
}

// A share from 0, best, to 1, worst: by rank, so that one bad run does not make all others look alike.
function ranks(values, goal) {
  const sorted = [...values].sort((a, b) => (goal === "low" ? a - b : b - a));
  return (value) => (sorted.length > 1 ? (sorted.indexOf(value) + sorted.lastIndexOf(value)) / 2 / (sorted.length - 1) : 0);
}

function cellOf(data, run, value, share, measure) {
  if (!run) return element("span", { class: "cell none" }, "\u00a0");
  const colour = present(value) ? scaleColour("sequential", 1 - share) : null;
  const dark = colour && colour[0] * 0.3 + colour[1] * 0.59 + colour[2] * 0.11 < 125;
  const link = data.pages[run.shape];
  const text = run.status === "ok" ? digits(value, 4) : run.status.replace("_", " ");
  const name = `${run.column} on ${run.shape}: ${measure.words} ${text || "unknown"}`;
  const cell = element(link ? "a" : "span", { class: `cell${dark ? " dark" : ""}${colour ? "" : " none"}`, href: link ?? null, title: name, "aria-label": name });
  if (colour) cell.style.setProperty("--cell", `rgb(${colour.map(Math.round).join(" ")})`);
  if (run.picture) cell.append(element("img", { src: run.picture, alt: "", loading: "lazy", width: 128, height: 96 }));
  cell.append(text || "\u00a0");
  return cell;
}

export function showGrid(data) {
  const { runs, columns, shapes } = data;
  const first = (shape, column) => runs.find((run) => run.shape === shape && run.column === column);
  const update = () => {
    const k = Number(byId("measure").value);
    const measure = data.measures[k];
    const found = new Map(shapes.map((shape) => [shape, columns.map((column) => means(runs, shape, column, k))]));
    const share = ranks([...found.values()].flat().filter(present), measure.goal);
    const badness = (shape) => Math.max(-1, ...found.get(shape).filter(present).map(share));
    const order = byId("order").value === "worst" ? [...shapes].sort((a, b) => badness(b) - badness(a)) : shapes;
    const heads = ["shape", ...(data.truths ? ["ground truth"] : []), ...columns];
    byId("grid").tHead.replaceChildren(element("tr", {}, ...heads.map((name) => element("th", { scope: "col" }, name))));
    byId("grid").tBodies[0].replaceChildren(...order.map((shape) => {
      const row = element("tr", {}, element("th", { scope: "row" }, shape));
      if (data.truths) row.append(element("td", {}, ...(data.truths[shape] ? [element("img", { src: data.truths[shape], alt: `ground truth of ${shape}`, loading: "lazy", width: 128, height: 96 })] : [])));
      columns.forEach((column, place) => {
        const value = found.get(shape)[place];
        row.append(element("td", {}, cellOf(data, first(shape, column), value, present(value) ? share(value) : 0, measure)));
      });
      return row;
    }));
    byId("ramp-bar").style.background = gradient("sequential");
    [byId("ramp-low").textContent, byId("ramp-high").textContent] = ["worst", "best (by rank)"];
  };
  ["measure", "order"].forEach((id) => byId(id).addEventListener("change", update));
  update();
}
