// Open: files, their columns and units, findings, the column map.
import { call } from "./api.js";
import { h, fill, button, select, findings, sketch } from "./dom.js";

export class OpenView {
  constructor(root, app) {
    Object.assign(this, { root, app, known: new Map() });
    this.list = h("div", { class: "files" });
    this.found = h("div", {});
    root.append(
      h("div", { class: "drop" },
        h("p", {}, h("strong", {}, "Drop recordings here"), " or anywhere on the page"),
        button("Choose recordings …", () => document.getElementById("chooser").click(), { class: "primary" }),
        h("p", { class: "soft" }, "CSV and other logs with time, position and force. They stay on this computer.")),
      this.list, this.found);
  }

  // The result of an upload, so that it need not be asked for again.
  remember(found) { this.known.set(found.file, found); }

  async update() {
    const { state } = this.app;
    fill(this.list, state.files.map(file => h("div", { class: "file" },
      button(file, () => this.app.select(file), { class: "link", "aria-pressed": String(file === this.app.file) }),
      button("Remove", () => this.app.attempt(async () => { this.known.delete(file); await this.app.refresh(await call("remove", { file })); }),
        { class: "quiet", "aria-label": `Remove ${file}` }))));
    if (!this.app.file) { fill(this.found); return; }
    const found = this.known.get(this.app.file) || await call("inspect", { file: this.app.file });
    this.remember(found);
    this.show(found);
  }

  async correct(request, message = "column") {
    await this.app.attempt(async () => {
      const found = await call(message, request);
      this.known.clear();
      this.remember(found);
      await this.app.refresh();
    });
  }

  // For a file without time, or with a sample number in its place.
  rate(file) {
    const number = h("input", { type: "text", inputmode: "decimal", size: "6", "aria-label": "samples per second" });
    const use = event => { event.preventDefault(); this.correct({ file, rate_hz: Number(number.value.replace(",", ".")) || 0 }, "rate"); };
    return h("form", { class: "inline", onsubmit: use }, "No column with the time? Samples per second", number, h("button", { type: "submit" }, "Use it"));
  }

  show(found) {
    const quantity = name => found.quantities.find(q => q.name === name);
    const rows = found.columns.map(column => {
      const request = { file: found.file, column: column.name, quantity: column.quantity, unit: column.unit, flipped: column.flipped };
      const names = [["", "not used"], ...found.quantities.map(q => [q.name, q.name])];
      const units = column.quantity ? quantity(column.quantity).units : [];
      return h("tr", { class: column.quantity ? "used" : "unused" },
        h("th", { scope: "row" }, column.name),
        h("td", {}, sketch(column.sketch || []), h("span", { class: "range" }, column.range)),
        h("td", {}, select(`quantity of ${column.name}`, names, column.quantity, value => this.correct({ ...request, quantity: value, unit: "" }))),
        h("td", {}, units.length > 0 && select(`unit of ${column.name}`, units.includes(column.unit) ? units : [[column.unit, column.unit || "?"], ...units], column.unit, value => this.correct({ ...request, unit: value }))),
        h("td", {}, column.quantity && column.quantity !== "time" && h("label", {}, h("input", { type: "checkbox", checked: column.flipped, onchange: event => this.correct({ ...request, flipped: event.target.checked }) }), " flip sign")),
        h("td", { class: "soft" }, column.reason));
    });
    const guessed = !this.app.state.map && found.readable && found.findings.some(f => f.level === "bad") && found.columns.find(c => c.quantity === "position");
    fill(this.found,
      h("h2", {}, found.file),
      h("p", {}, found.summary),
      findings(found.findings),
      found.findings.some(f => f.level === "bad") && h("p", { class: "soft" }, "Correct what is wrong in the table; the column map is written for you."),
      rows.length > 0 && h("div", { class: "table", tabindex: "0", role: "region", "aria-label": "columns" }, h("table", { class: "columns" },
        h("thead", {}, h("tr", {}, ["column", "values", "is", "in", "sign", "because"].map(name => h("th", { scope: "col" }, name)))),
        h("tbody", {}, rows))),
      h("div", { class: "row" },
        guessed && button(`Yes, the position is in ${guessed.unit}`, () => this.correct({ file: found.file, column: guessed.name, quantity: "position", unit: guessed.unit, flipped: guessed.flipped })),
        !found.readable && this.rate(found.file),
        button("Look at it →", () => this.app.show("look"), { class: "primary", disabled: !found.readable }),
        this.app.state.map && button("Forget the map", () => this.app.attempt(async () => { this.known.clear(); await this.app.refresh(await call("forget_map")); }))),
      h("details", {}, h("summary", {}, this.app.state.map ? "Column map, saved as columns.ron" : "Column map"), h("pre", { tabindex: "0" }, found.map)));
  }
}
