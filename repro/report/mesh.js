// Triangles of three or six nodes with one value for each node or triangle, cut into bands between limits.
"use strict";
const LEVELS = 65534;

function bytes(text) { return Uint8Array.from(atob(text), letter => letter.charCodeAt(0)); }
function shorts(text) { const raw = bytes(text); return new Uint16Array(raw.buffer); }

// A mesh: cells, which of them are of the aggregate, its nodes and triangles in ascending order, and
// its edge with the fluid.
function meshOf(stored) {
  if (stored.ready) return stored.ready;
  const cells = new Uint32Array(bytes(stored.cells).buffer), body = bytes(stored.body), per = stored.per;
  const nodes = new Set(), triangles = [], sides = new Map();
  for (let t = 0; t < body.length; t++) {
    if (body[t]) triangles.push(t);
    for (let i = 0; i < per; i++) if (body[t]) nodes.add(cells[t * per + i]);
    for (let i = 0; i < 3; i++) {
      const a = cells[t * per + i], b = cells[t * per + (i + 1) % 3], key = Math.min(a, b) + "," + Math.max(a, b);
      const middle = per === 6 ? cells[t * per + 3 + i] : -1;
      if (!sides.has(key)) sides.set(key, { a, b, middle, of: [] });
      sides.get(key).of.push(body[t]);
    }
  }
  const edges = [...sides.values()];
  stored.ready = { cells, body, per, nodes: Uint32Array.from(nodes).sort(), triangles, edges,
    rim: edges.filter(edge => edge.of.length === 2 && edge.of[0] !== edge.of[1]) };
  return stored.ready;
}

// Coordinates of the nodes, um.
function pointsOf(frame, [x0, x1, y0, y1]) {
  const raw = shorts(frame.points), points = new Float64Array(raw.length);
  for (let k = 0; k < raw.length; k += 2) {
    points[k] = x0 + raw[k] / LEVELS * (x1 - x0);
    points[k + 1] = y0 + raw[k + 1] / LEVELS * (y1 - y0);
  }
  return points;
}

// One value for each node or triangle; NaN for none.
function valuesOf(frame, field, mesh, count) {
  const [low, high, text] = frame.values[field.name], raw = shorts(text);
  const nodal = new Float64Array(count).fill(NaN);
  const places = field.body ? field.at === "node" ? mesh.nodes : mesh.triangles : null;
  raw.forEach((level, k) => {
    if (level <= LEVELS) nodal[places ? places[k] : k] = low + level / LEVELS * (high - low);
  });
  return nodal;
}

// Weights of a triangle's nodes at a place (a, b).
function weights(per, a, b) {
  const c = 1 - a - b;
  return per === 3 ? [c, a, b] : [c * (2 * c - 1), a * (2 * a - 1), b * (2 * b - 1), 4 * c * a, 4 * a * b, 4 * b * c];
}

// The straight parts of a triangle, as weights at their corners: the whole, or count * count parts of a curved one.
function partsOf(per, count) {
  const parts = [], at = (p, q) => weights(per, p / count, q / count);
  for (let i = 0; i < count; i++) for (let j = 0; i + j < count; j++) {
    parts.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
    if (i + j < count - 1) parts.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
  }
  return parts;
}

// The straight pieces of a field: x, y and value at three corners, nine numbers each. Pieces without a value are left
// out. Few triangles are large, so that their curves need more pieces.
function piecesOf(mesh, places, values, atNodes) {
  const { cells, per, body } = mesh, parts = partsOf(per, per === 3 ? 1 : body.length > 500 ? 2 : 4), pieces = [];
  for (let t = 0; t < body.length; t++) for (const part of parts) {
    const corners = [];
    for (const share of part) {
      let x = 0, y = 0, value = atNodes ? 0 : values[t];
      for (let i = 0; i < per; i++) {
        const node = cells[t * per + i];
        x += share[i] * places[2 * node]; y += share[i] * places[2 * node + 1];
        if (atNodes) value += share[i] * values[node];
      }
      corners.push(x, y, value);
    }
    if (!isNaN(corners[2] + corners[5] + corners[8])) pieces.push(...corners);
  }
  return Float64Array.from(pieces);
}

function areaOf(pieces) {
  let area = 0;
  for (let k = 0; k < pieces.length; k += 9) area += Math.abs(twiceArea(pieces, k)) / 2;
  return area;
}
function twiceArea(p, k) {
  return (p[k + 3] - p[k]) * (p[k + 7] - p[k + 1]) - (p[k + 6] - p[k]) * (p[k + 4] - p[k + 1]);
}

// The value at a place; NaN outside of all pieces.
function fieldAt(p, x, y) {
  const slack = -1e-6;
  for (let k = 0; k < p.length; k += 9) {
    const area = twiceArea(p, k);
    const b = ((x - p[k]) * (p[k + 7] - p[k + 1]) - (p[k + 6] - p[k]) * (y - p[k + 1])) / area;
    const c = ((p[k + 3] - p[k]) * (y - p[k + 1]) - (x - p[k]) * (p[k + 4] - p[k + 1])) / area;
    if (b >= slack && c >= slack && 1 - b - c >= slack)
      return p[k + 2] + b * (p[k + 5] - p[k + 2]) + c * (p[k + 8] - p[k + 2]);
  }
  return NaN;
}

// The outlines of the bands below, between and above ascending limits, one path each.
function bandsOf(pieces, limits) {
  const bands = Array.from({ length: limits.length + 1 }, () => []);
  for (let k = 0; k < pieces.length; k += 9) {
    const corners = [0, 3, 6].map(i => [pieces[k + i], pieces[k + i + 1], pieces[k + i + 2]]);
    cut(corners.sort((a, b) => a[2] - b[2]), limits, bands);
  }
  return bands.map(band => band.join(""));
}

// Adds the parts of a piece to their bands. Each limit between its least and largest value cuts it along a line, from
// the edge between these two corners to one of the other two edges.
function cut([least, middle, largest], limits, bands) {
  let band = limits.findIndex(limit => limit > least[2]), started = [least];
  if (band < 0) band = limits.length;
  for (let above = false; ; band++) {
    const ends = band >= limits.length || limits[band] >= largest[2], limit = limits[band];
    const turns = !above && (ends || middle[2] < limit);
    above ||= turns;
    const ended = ends ? [largest] : [between(least, largest, limit),
      above ? between(middle, largest, limit) : between(least, middle, limit)];
    bands[band].push(polygon([...started, ...ended, ...(turns ? [middle] : [])]));
    if (ends) return;
    started = ended.reverse();
  }
}
function between(a, b, value) {
  const share = (value - a[2]) / (b[2] - a[2]);
  return [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
}
function tenths(value) { return Math.round(10 * value) / 10; }
function polygon(corners) { return "M" + corners.map(([x, y]) => tenths(x) + " " + tenths(y)).join("L") + "Z"; }
