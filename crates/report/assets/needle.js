// A needle that moves through the layers beside a chart, while the curves are drawn up to its time.
const PLAY_S = 8;

// Position of the tip at a time.
function tipAt(needle, t) {
  const i = Math.max(1, Math.min(needle.time.length - 1, lowerBound(needle.time, t)));
  const [t0, t1, z0, z1] = [needle.time[i - 1], needle.time[i], needle.tip[i - 1], needle.tip[i]];
  return t1 > t0 ? z0 + (z1 - z0) * Math.max(0, Math.min(1, (t - t0) / (t1 - t0))) : z0;
}

function drawNeedle(view) {
  const { needle } = view, { canvas } = needle, ratio = devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * ratio; canvas.height = height * ratio;
  const ctx = canvas.getContext("2d"), ink = isDark() ? "#eef1f4" : "#1b1f24";
  ctx.scale(ratio, ratio);
  const deepest = Math.max(needle.deepest, needle.faces[needle.faces.length - 1]);
  const top = Math.min(needle.shallowest, needle.faces[0] - 0.15 * (deepest - needle.faces[0]));
  const y = mm => 4 + (height - 8) * (mm - top) / (deepest * 1.04 - top);
  const hues = ["sky_blue", "orange", "green", "purple"];
  needle.faces.slice(1).forEach((face, k) => {
    const from = y(needle.faces[k]), to = y(face);
    ctx.fillStyle = withAlpha(colour(hues[k % hues.length]), 0.3);
    ctx.fillRect(0, from, width, to - from);
    ctx.fillStyle = ink; ctx.font = `11px ${FONT}`; ctx.textBaseline = "top";
    if (to - from > 16) ctx.fillText("layer " + (k + 1), 4, from + 3);
  });
  const t = view.playhead === null ? needle.deepestTime : view.playhead, tip = y(tipAt(needle, t)), x = 0.68 * width;
  ctx.fillStyle = ink;
  ctx.beginPath();
  ctx.moveTo(x - 2.5, 0); ctx.lineTo(x + 2.5, 0); ctx.lineTo(x + 2.5, Math.max(0, tip - 9)); ctx.lineTo(x, tip); ctx.lineTo(x - 2.5, Math.max(0, tip - 9));
  ctx.closePath(); ctx.fill();
  needle.output.textContent = `${t.toFixed(2)} s, ${tipAt(needle, t).toFixed(1)} mm`;
}

// Covers what lies behind the time of the needle.
function placeCover(view) {
  if (!view.needle) return;
  const { cover } = view.needle, left = view.playhead === null ? Infinity : view.u.valToPos(view.playhead, "x");
  cover.hidden = !(left < view.u.over.clientWidth);
  cover.style.left = Math.max(0, left) + "px";
}

function buildNeedle(view, number) {
  view.playhead = null;
  if (!view.spec.needle) return;
  const player = document.getElementById("player-" + number), [button, slider, output] = player.children;
  const time = payload.columns[view.spec.needle.time], tip = payload.columns[view.spec.needle.tip], faces = view.spec.needle.faces;
  const [shallowest, deepest] = finiteExtent(tip, 0, tip.length, isNumber);
  view.needle = { time, tip, faces, shallowest, deepest, deepestTime: time[tip.indexOf(deepest)], output,
    canvas: document.getElementById("needle-" + number), cover: document.createElement("div") };
  view.needle.cover.className = "cover";
  view.u.over.append(view.needle.cover);
  view.needle.canvas.style.height = view.spec.height + "px";
  const first = time[0], last = time[time.length - 1];
  let started = null;
  const show = share => {
    view.playhead = share >= 1 ? null : first + share * (last - first);
    slider.value = 1000 * share;
    drawNeedle(view);
    placeCover(view);
  };
  const stop = () => { started = null; button.textContent = "Play"; };
  const frame = now => {
    if (started === null) return;
    const share = Math.min(1, (now - started) / (1000 * PLAY_S));
    show(share);
    if (share < 1) requestAnimationFrame(frame); else stop();
  };
  button.addEventListener("click", () => {
    if (started !== null) { stop(); return; }
    button.textContent = "Pause";
    const share = Number(slider.value) / 1000;
    started = performance.now() - (share < 1 ? share : 0) * 1000 * PLAY_S;
    requestAnimationFrame(frame);
  });
  slider.addEventListener("input", () => { stop(); show(Number(slider.value) / 1000); });
  view.repaint.push(() => drawNeedle(view));
  drawNeedle(view);
  placeCover(view);
}
