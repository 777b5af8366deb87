// Elements. Text from files, columns, layers and scenarios only ever becomes a text node.

export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && typeof value !== "string") element[name] = value;
    else if (name === "class") element.className = value;
    else if (name === "value" || name === "textContent") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter(child => child !== null && child !== undefined && child !== false));
  return element;
}

export function fill(element, ...children) {
  element.replaceChildren(...children.flat().filter(child => child !== null && child !== undefined && child !== false));
  return element;
}

export function button(label, onclick, properties = {}) {
  return h("button", { type: "button", onclick, ...properties }, label);
}

export function select(label, options, value, onchange, properties = {}) {
  const box = h("select", { "aria-label": label, onchange: event => onchange(event.target.value), ...properties });
  for (const option of options) {
    const [name, text] = Array.isArray(option) ? option : [option, option];
    box.append(h("option", { value: name, selected: name === value }, text));
  }
  return box;
}

export function table({ head, rows }, caption) {
  return h("div", { class: "table", tabindex: "0", role: "region", "aria-label": caption },
    h("table", {},
      h("thead", {}, h("tr", {}, head.map(name => h("th", { scope: "col" }, name)))),
      h("tbody", {}, rows.map(row => h("tr", {}, row.map(cell => h("td", {}, cell)))))));
}

export function findings(list) {
  const marks = { bad: "✕", warn: "!", good: "✓" }, names = { bad: "error", warn: "note", good: "good" };
  return h("ul", { class: "findings" }, list.map(f =>
    h("li", { class: f.level }, h("span", { class: "mark", "aria-label": names[f.level], role: "img" }, marks[f.level]), h("span", {}, f.message))));
}

// A slider with its number. `change(target, last)` gets { position } or { text }; `last` is false while the mouse moves.
export function slider(view, change) {
  const id = `s${slider.count = (slider.count || 0) + 1}`;
  const range = h("input", { type: "range", id, min: "0", max: String(view.positions - 1), step: "1", "aria-valuetext": `${view.text} ${view.unit}` });
  const number = h("input", { type: "text", class: "number", inputmode: "decimal", "aria-label": `${view.label} in ${view.unit || "units"}`, placeholder: "none", size: "7" });
  const row = h("div", { class: "slider", title: view.help },
    h("label", { for: id }, view.label), range, number, h("span", { class: "unit" }, view.unit));
  let drawn = null;
  row.update = now => {
    if (drawn && range.value === String(now.position) && number.value === now.text) return;
    drawn = now;
    if (document.activeElement !== range || Number(range.value) !== now.position) range.value = String(now.position);
    if (document.activeElement !== number) number.value = now.text;
    range.setAttribute("aria-valuetext", `${now.text || "none"} ${now.unit}`);
  };
  row.update(view);
  range.addEventListener("input", () => change({ position: Number(range.value) }, false));
  range.addEventListener("change", () => change({ position: Number(range.value) }, true));
  number.addEventListener("change", () => change({ text: number.value }, true));
  number.addEventListener("keydown", event => { if (event.key === "Escape") { number.value = drawn.text; number.blur(); } });
  return row;
}

export function sketch(values) {
  const finite = values.filter(v => v !== null), low = Math.min(...finite), high = Math.max(...finite), span = high - low || 1;
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("class", "sketch");
  svg.setAttribute("viewBox", "0 0 100 24");
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("aria-hidden", "true");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
  const points = values.map((v, k) => v === null ? null : `${(100 * k / Math.max(1, values.length - 1)).toFixed(1)},${(22 - 20 * (v - low) / span).toFixed(1)}`);
  line.setAttribute("points", points.filter(p => p).join(" "));
  svg.append(line);
  return svg;
}
