// Fields over time, with axes, a colour bar and a slider.
"use strict";
const data = JSON.parse(document.getElementById("fields").textContent);
const part = Object.fromEntries(["picture", "field", "frame", "now", "probe", "lines", "outline", "whole", "fixed",
  "play", "save"].map(id => [id, document.getElementById(id)]));

function rangeOf(field, frame) {
  const pairs = (part.fixed.checked ? data.frames : [frame]).map(each => each.values[field.name])
    .filter(pair => pair && pair[2]);
  const low = Math.min(...pairs.map(pair => pair[0])), high = Math.max(...pairs.map(pair => pair[1]));
  if (!isFinite(low)) return [0, 0];
  return high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high)) ? [low, high] : [low, low];  // round-off is none
}

// Where a value stands between the first and the last colour: logarithmic from two decades on, over four at most.
function shareOf(low, high) {
  if (!(low > 0 && high >= 100 * low)) return { least: low, log: false, at: value => (value - low) / (high - low) };
  const least = Math.max(low, 1e-4 * high), decades = Math.log(high / least);
  return { least, log: true, at: value => Math.log(Math.max(value, least) / least) / decades };
}

function boxOf(points) {
  if (part.whole.checked) return data.box;
  let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let k = 0; k < points.length; k += 2) {
    x0 = Math.min(x0, points[k]); x1 = Math.max(x1, points[k]);
    y0 = Math.min(y0, points[k + 1]); y1 = Math.max(y1, points[k + 1]);
  }
  return [x0, x1, y0, y1];
}

// Pixels per um: as wide as the page, but neither higher than the window nor too thin to see.
function scaleOf(box, room) {
  const tallest = Math.max(200, 0.65 * window.innerHeight), least = 60;
  const scale = Math.min(room / (box[1] - box[0]), tallest / (box[3] - box[2]));
  return Math.max(scale, least / (box[3] - box[2]));
}

let drawn = null; // read by the probe
function draw() {
  const frame = data.frames[part.frame.value], field = data.fields.find(each => each.name === part.field.value);
  const mesh = meshOf(data.meshes[frame.mesh]), points = pointsOf(frame, data.box), [low, high] = rangeOf(field, frame);
  const values = valuesOf(frame, field, mesh, field.at === "node" ? points.length / 2 : mesh.body.length);
  const ratio = Math.min(3, window.devicePixelRatio || 1), edge = { left: 40, right: 12, top: 8, bottom: 98 };
  const box = boxOf(points), room = Math.max(120, part.picture.parentElement.clientWidth) - edge.left - edge.right;
  const scale = scaleOf(box, room), across = scale * (box[1] - box[0]), tall = scale * (box[3] - box[2]);
  const wide = Math.max(across, room) + edge.left + edge.right;
  const place = (x, y) => [edge.left + (x - box[0]) * scale, edge.top + tall - (y - box[2]) * scale];
  const size = [Math.round(across * ratio), Math.round(tall * ratio)];
  const pixels = new Float64Array(points.length), places = new Float64Array(points.length);
  for (let k = 0; k < points.length; k += 2) {
    [places[k], places[k + 1]] = place(points[k], points[k + 1]);
    pixels[k] = (places[k] - edge.left) * ratio; pixels[k + 1] = (places[k + 1] - edge.top) * ratio;
  }
  part.picture.width = Math.round(wide * ratio);
  part.picture.height = Math.round((tall + edge.top + edge.bottom) * ratio);
  part.picture.style.width = `${wide}px`;
  const pen = part.picture.getContext("2d"), all = filled(mesh, pixels, values, field.at === "node", ...size);
  pen.putImageData(image(all, low, high, ...size), Math.round(edge.left * ratio), Math.round(edge.top * ratio));
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.globalCompositeOperation = "destination-over"; // a saved picture has the colour of the page
  pen.fillStyle = ink("--back"); pen.fillRect(0, 0, wide, tall + edge.top + edge.bottom);
  pen.globalCompositeOperation = "source-over";
  pen.font = "12px system-ui, sans-serif";
  if (part.lines.checked) trace(pen, mesh.edges, places, "rgba(128,128,128,.55)", 0.7);
  if (part.outline.checked)
    for (const [colour, width] of [["#ffffff", 3], ["#000000", 1.2]]) trace(pen, mesh.rim, places, colour, width);
  axes(pen, box, place, tall);
  const long = Math.min(420, room);
  bar(pen, field, low, high, all.some(isNaN), edge.left + Math.max(0, across - long) / 2, edge.top + tall + 52, long);
  drawn = { all, size, ratio, edge, scale, tall, across, box, field };
  cross(pen);
  describe(frame, field, low, high);
}

// A colour of the page.
function ink(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

function image(all, low, high, width, height) {
  const pixels = new ImageData(width, height), colours = new Uint32Array(pixels.data.buffer);
  const dark = matchMedia("(prefers-color-scheme: dark)").matches, none = dark ? 0xff363128 : 0xffe8e4e0;
  const shares = shareOf(low, high);
  for (let k = 0; k < all.length; k++) {
    const share = isNaN(all[k]) ? NaN : high > low ? shares.at(all[k]) : 0.5;
    colours[k] = isNaN(share) ? none : TABLE[Math.round(Math.max(0, Math.min(1, share)) * 255)];
  }
  return pixels;
}

function trace(pen, edges, places, ink, width) {
  pen.strokeStyle = ink;
  pen.lineWidth = width;
  pen.beginPath();
  for (const { a, b, middle } of edges) {
    const [ax, ay, bx, by] = [places[2 * a], places[2 * a + 1], places[2 * b], places[2 * b + 1]];
    pen.moveTo(ax, ay);
    const [mx, my] = [2 * places[2 * middle] - (ax + bx) / 2, 2 * places[2 * middle + 1] - (ay + by) / 2];
    if (middle < 0) pen.lineTo(bx, by); else pen.quadraticCurveTo(mx, my, bx, by);
  }
  pen.stroke();
}

function roundTicks(low, high, parts) {
  if (!(high > low)) return [low];
  const power = 10 ** Math.floor(Math.log10((high - low) / parts));
  const step = [1, 2, 5, 10].map(k => k * power).find(each => each >= (high - low) / parts * 0.999), ticks = [];
  for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k++) ticks.push(k * step);
  return ticks;
}

function axes(pen, box, place, tall) {
  const [left, bottom] = place(box[0], box[2]), [right, top] = place(box[1], box[3]);
  pen.strokeStyle = ink("--faint"); pen.fillStyle = ink("--text"); pen.lineWidth = 1;
  pen.strokeRect(left, top, right - left, bottom - top);
  pen.textAlign = "center"; pen.textBaseline = "top";
  for (const x of roundTicks(box[0], box[1], right - left > 500 ? 10 : 5)) {
    pen.fillRect(place(x, 0)[0] - 0.5, bottom, 1, 4);
    pen.fillText(rounded(x), place(x, 0)[0], bottom + 6);
  }
  pen.fillText("x (um)", (left + right) / 2, bottom + 21);
  pen.textAlign = "right"; pen.textBaseline = "middle";
  for (const y of roundTicks(box[2], box[3], tall > 150 ? 5 : 2)) {
    pen.fillRect(left - 4, place(0, y)[1] - 0.5, 4, 1);
    pen.fillText(rounded(y), left - 6, place(0, y)[1]);
  }
  pen.save(); pen.translate(8, (top + bottom) / 2); pen.rotate(-Math.PI / 2);
  pen.textAlign = "center"; pen.fillText("y (um)", 0, 0); pen.restore();
}

// The values beside the bar: round ones, or powers of ten.
function barTicks(low, high, shares) {
  if (!shares.log) return roundTicks(low, high, 4);
  const ticks = [];
  for (let power = Math.ceil(Math.log10(low)); 10 ** power <= high; power++) ticks.push(10 ** power);
  return ticks;
}

function bar(pen, field, least, high, grey, left, top, width) {
  const shares = shareOf(least, high), low = shares.least;
  const why = field.body ? "not defined in the fluid" : "not meshed at this time";
  const name = field.label + (field.unit ? ` (${field.unit})` : "") + (shares.log ? ", log scale" : "")
    + (grey ? `; grey: ${why}` : "");
  pen.fillStyle = ink("--text"); pen.textAlign = "left"; pen.textBaseline = "top";
  if (!(high > low)) return void pen.fillText(`${name}: ${rounded(low)} everywhere`, left, top);
  for (let k = 0; k < width; k++) {
    pen.fillStyle = `rgb(${colour(k / (width - 1)).map(Math.round).join()})`;
    pen.fillRect(left + k, top, 1.5, 12);
  }
  pen.fillStyle = ink("--text");
  const text = value => (value === low && low > least ? "\u2264 " : "")
    + rounded(Math.abs(value) < 1e-12 * (high - low) ? 0 : value);
  const wide = value => pen.measureText(text(value)).width, place = value => left + shares.at(value) * width;
  const first = left + wide(low) + 8, last = left + width - wide(high) - 8; // the ends are exact
  const between = barTicks(low, high, shares).filter(value =>
    place(value) - wide(value) / 2 > first && place(value) + wide(value) / 2 < last);
  for (const value of [low, ...between, high]) {
    const x = place(value);
    pen.textAlign = value === low ? "left" : value === high ? "right" : "center";
    pen.fillRect(Math.min(x, left + width - 1), top + 12, 1, 4);
    pen.fillText(text(value), x, top + 17);
  }
  pen.textAlign = "left"; pen.fillText(name, left, top + 32);
}

// Describes the picture, for the reader and, in data attributes, for a test.
function describe(frame, field, low, high) {
  const text = `t = ${rounded(frame.time)} h${frame.note ? `, ${frame.note}` : ""}`;
  part.now.textContent = `${text} (${Number(part.frame.value) + 1} of ${data.frames.length})`;
  part.frame.setAttribute("aria-valuetext", text);
  const range = `${rounded(low)} to ${rounded(high)} ${field.unit}`;
  part.picture.setAttribute("aria-label", `${field.label}, ${range}, at ${text}`);
  const share = value => high > low ? (value - low) / (high - low) : 0;
  const hashed = (sum, value) => isNaN(value) ? sum : (sum * 31 + Math.round(1e6 * share(value))) % 1000000007;
  Object.assign(part.picture.dataset, { frame: part.frame.value, field: field.name, low, high,
    seen: drawn.all.reduce(hashed, 7),
    filled: drawn.all.reduce((sum, value) => sum + !isNaN(value), 0) / drawn.all.length });
  tellAll(frame.time);
}

function probe(event) {
  const frame = part.picture.getBoundingClientRect();
  read(event.clientX - frame.left - drawn.edge.left, event.clientY - frame.top - drawn.edge.top);
}

// Shows the value at a place, in pixels from the upper left corner of the field.
function read(across, down) {
  const { all, size, ratio, scale, tall, box, field } = drawn;
  const inside = across >= 0 && down >= 0 && across * ratio < size[0] && down * ratio < size[1];
  const value = inside ? all[Math.floor(down * ratio) * size[0] + Math.floor(across * ratio)] : NaN;
  const x = (box[0] + across / scale).toFixed(1), y = (box[2] + (tall - down) / scale).toFixed(1);
  const words = isNaN(value) ? "none here" : `${field.label} ${rounded(value)} ${field.unit}`;
  part.probe.textContent = inside ? `x = ${x} um, y = ${y} um: ${words}` : "\u00a0";
}

// The place that the arrow keys move, as shares of the field's width and height; null before the first key.
let cursor = null;
const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
function move(event) {
  if (!STEPS[event.key]) return;
  event.preventDefault();
  const size = event.shiftKey ? 0.1 : 0.02, within = value => Math.min(0.999, Math.max(0.001, value));
  cursor = cursor ? cursor.map((value, k) => within(value + size * STEPS[event.key][k])) : [0.5, 0.5];
  draw();
  read(cursor[0] * drawn.across, cursor[1] * drawn.tall);
}

function cross(pen) {
  if (!cursor) return;
  const x = drawn.edge.left + cursor[0] * drawn.across, y = drawn.edge.top + cursor[1] * drawn.tall;
  for (const [colour, width] of [["#ffffff", 3], ["#000000", 1.2]]) {
    pen.strokeStyle = colour; pen.lineWidth = width;
    pen.beginPath(); pen.moveTo(x - 7, y); pen.lineTo(x + 7, y); pen.moveTo(x, y - 7); pen.lineTo(x, y + 7); pen.stroke();
  }
}

function save() {
  part.picture.toBlob(content => {
    const link = document.createElement("a"), frame = data.frames[part.frame.value];
    link.href = URL.createObjectURL(content);
    link.download = `${part.field.value}_${rounded(frame.time)}h.png`;
    link.click();
    URL.revokeObjectURL(link.href);
  });
}

// A fragment such as #frame=3&field=theta chooses the frame and the field.
function chosen() {
  const requested = new URLSearchParams(location.hash.slice(1));
  if (data.frames[requested.get("frame")]) part.frame.value = requested.get("frame");
  if (data.fields.some(field => field.name === requested.get("field"))) part.field.value = requested.get("field");
  draw();
}

let timer = null;
function play() {
  part.play.textContent = timer ? "Play" : "Pause";
  if (timer) { clearInterval(timer); timer = null; return; }
  timer = setInterval(() => { part.frame.value = (Number(part.frame.value) + 1) % data.frames.length; draw(); }, 250);
}

for (const field of data.fields) part.field.add(new Option(field.label, field.name));
part.frame.max = data.frames.length - 1;
part.field.value = data.start.field;
part.frame.value = data.start.frame;
for (const id of ["field", "frame", "lines", "outline", "whole", "fixed"]) part[id].addEventListener("input", draw);
part.play.addEventListener("click", play);
part.save.addEventListener("click", save);
part.picture.addEventListener("keydown", move);
part.picture.addEventListener("blur", () => { cursor = null; draw(); });
part.picture.addEventListener("pointermove", probe);
part.picture.addEventListener("pointerleave", () => { part.probe.textContent = "\u00a0"; });
document.addEventListener("timechosen", event => {
  part.frame.value = nearest(data.frames.map(frame => frame.note ? Infinity : frame.time), event.detail);
  draw();
});
window.addEventListener("hashchange", chosen);
window.addEventListener("resize", draw);
window.addEventListener("load", () => { // the middle, where the aggregate is
  const around = part.picture.parentElement;
  around.scrollLeft = (around.scrollWidth - around.clientWidth) / 2;
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
chosen();
document.documentElement.dataset.fields = data.fields.length;
