// The list of parts: shows and hides them, and picks one.

export class PartTable {
  constructor(data, surfaces, colouring, request) {
    Object.assign(this, { surfaces, colouring, request });
    this.rows = [...document.querySelectorAll("#parts tbody tr")];
    this.rows.forEach((row, part) => {
      row.querySelector(".swatch").style.background = data.parts[part].colour;
      row.querySelector("input").addEventListener("change", (event) => this.show(part, event.target.checked));
      row.querySelector("button").addEventListener("click", () => this.pick(colouring.picked === part ? null : part));
    });
    const all = document.getElementById("all-parts");
    all.addEventListener("change", () => this.rows.forEach((row, part) => {
      row.querySelector("input").checked = all.checked;
      this.show(part, all.checked);
    }));
  }

  show(part, visible) {
    for (const surface of this.surfaces) {
      for (const piece of surface.pieces) if (piece.part === part) piece.object.visible = visible;
    }
    this.request();
  }

  // Scroll the controls, but not the page, to a row.
  reveal(row) {
    const controls = document.querySelector(".controls");
    const [outer, inner] = [controls, row].map((element) => element.getBoundingClientRect());
    controls.scrollTop += Math.max(inner.bottom - outer.bottom, 0) - Math.max(outer.top - inner.top, 0);
  }

  pick(part) {
    this.colouring.picked = part;
    this.rows.forEach((row, other) => {
      row.classList.toggle("picked", other === part);
      row.querySelector("button").setAttribute("aria-pressed", String(other === part));
    });
    if (part !== null) this.reveal(this.rows[part]);
    this.colouring.update();
  }
}
