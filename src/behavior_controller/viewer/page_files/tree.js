"use strict";
// The mission's tree, as a list and as a graph: two layouts of the same rows, so that status, folding, search and keys are
// those of both.

const DEEPEST = 100;  // nested lists; browsers give up far beyond, so what is deeper stands beside its parent
const MOST_STICKY = 5;
const MOST_UNFOLDED = 500;  // nodes of a tree that is unfolded at first: then nothing moves as it runs

let nodes = [];      // as the board has them, by uid - 1
let items = [];      // their rows, by uid - 1; none for nodes that are not shown
let letters = "";    // the status of each node, as shown
let tip = 0;         // uid of the running leaf, or of the failed one that a recovery does again
let follow = true;
let isAll = false;   // also the nodes that only say how the mission is put together
let opened = new Set();  // rows that only the running leaf has unfolded
let isGraph = false;

const labelOf = node => node.kind ? node.name + " " + node.kind : node.name;
const isOpen = one => one.getAttribute("aria-expanded") === "true";
const isHeld = one => one.classList.contains("sticky");
const parentItem = one => one.parentElement.closest("[role=treeitem]");

// the row of a node, or of the nearest one above it that has one
function rowOf(uid) {
  let node = nodes[uid - 1];
  while (node && !items[node.uid - 1]) node = nodes[node.parent - 1];
  return node ? items[node.uid - 1] : null;
}

// a row, or the one above it that is folded
function unfoldedOf(one) {
  let seen = one;
  for (let outer = one && parentItem(one); outer; outer = parentItem(outer)) if (!isOpen(outer)) seen = outer;
  return seen;
}

// the subtrees around a node, and the node itself
function whereabouts(node) {
  const around = [labelOf(node)];
  for (let outer = nodes[node.parent - 1]; outer; outer = nodes[outer.parent - 1]) if (outer.subtree) around.unshift(outer.name);
  return around.join(" › ");
}

// ------------------------------------------------------------------------------------------------------------- rows

function item(node) {
  const parent = rowOf(node.parent);
  const level = parent ? Number(parent.getAttribute("aria-level")) + 1 : 1;
  const held = parent ? Number(parent.dataset.held) + (isHeld(parent) ? 1 : 0) : 0;
  const made = element("li", node.subtree ? "subtree" : "");
  made.setAttribute("role", "treeitem");
  made.setAttribute("aria-level", level);
  made.tabIndex = -1;
  made.dataset.uid = node.uid;
  made.dataset.held = held;
  if ((node.subtree || !parent) && held < MOST_STICKY) {
    made.classList.add("sticky");
    made.style.setProperty("--held", held);
  }
  const row = element("div", "row");
  row.title = node.path;
  row.append(element("span", "fold"), element("span", "sign"), element("span", "name", node.name));
  row.children[1].setAttribute("role", "img");
  const [, kind, number] = /^(.*?)(#[0-9]+)?$/.exec(node.kind);
  if (kind) row.append(element("span", "type", kind.trim()));
  if (number) row.append(element("span", "type number", number));
  made.append(row);
  items[node.uid - 1] = made;
  if (parent) groupFor(parent, level).append(made);
  return made;
}

function groupFor(parent, level) {
  if (level > DEEPEST) return parent.parentElement;
  if (parent.lastChild.getAttribute("role") !== "group") {
    const group = element("ul");
    group.setAttribute("role", "group");
    parent.append(group);
    parent.setAttribute("aria-expanded", parent.classList.contains("subtree") && nodes.length > MOST_UNFOLDED ? "false" : "true");
  }
  return parent.lastChild;
}

function showMission(mission) {
  put(byId("mission"), "Mission " + mission.file.split("/").pop().replace(/\.xml$/, "")
      + (mission.robot && ` of ${mission.robot}`));
  document.title = byId("mission").textContent;
  nodes = mission.nodes;
  spoken = mission.language;
  closeNode();
  showTree();
}

function showTree() {
  const known = letters;
  items = new Array(nodes.length);
  letters = "";
  opened = new Set();
  for (const node of nodes) if (isAll || !node.bare) item(node);
  byId("tree").replaceChildren(...items.slice(0, 1));
  if (items.length) items[0].tabIndex = 0;
  showLetters(known);
  find();
  if (isGraph) showWhole();
}

function setAll(on) {
  isAll = on;
  byId("all").setAttribute("aria-pressed", on);
  showTree();
  if (follow) goToTip();
}

function showStatuses(statuses) {
  tip = statuses.tip;
  const before = letters;
  showLetters(statuses.letters);
  put(byId("running"), tip && nodes[tip - 1] ? whereabouts(nodes[tip - 1]) : "no node runs");
  if (follow) goToTip();
  if (opensUid && before[opensUid - 1] !== letters[opensUid - 1]) loadNode();
}

function showLetters(shown) {
  for (let place = 0; place < nodes.length; place++) {
    const letter = shown[place] || "-";
    if (items[place] && letters[place] !== letter) mark(items[place], letter);
  }
  letters = shown;
  markTip();
  drawMap();
}

function mark(one, letter) {
  one.classList.remove("R", "S", "F", "s", "f", "r");
  if (letter !== "-") one.classList.add(letter);
  markSign(one, letter);
}

function markSign(one, letter) {
  const made = one.querySelector(".sign");
  put(made, SIGNS[letter]);
  made.setAttribute("aria-label", WORDS[letter]);
}

// in the graph nothing unfolds by itself: all of it would move
function markTip() {
  for (const one of document.querySelectorAll(".tip")) {
    one.classList.remove("tip");
    markSign(one, letters[one.dataset.uid - 1] || "-");
  }
  const current = isGraph ? unfoldedOf(rowOf(tip)) : rowOf(tip);
  if (!current) return;
  current.classList.add("tip");
  if (current === items[tip - 1] && letters[tip - 1] !== "R") markSign(current, "again");
  if (!isGraph && current !== items[tip - 1] && follow && !isOpen(current)) {
    fold(current, false);
    opened.add(current);
  }
}

// ------------------------------------------------------------------------------------------------- folding and going

function fold(one, closed) {
  if (one.hasAttribute("aria-expanded")) one.setAttribute("aria-expanded", closed ? "false" : "true");
  opened.delete(one);
}

function foldByHand(some, closed) {
  setFollow(false);
  for (const one of some) fold(one, closed);
  if (isGraph) arrange();
}

function goToTip() {
  if (isGraph) centre(unfoldedOf(rowOf(tip)));
  else reveal(rowOf(tip), true);
}

// unfold what is around a row, and scroll there inside the tree
function reveal(current, isBriefly) {
  const path = new Set();
  for (let one = current; one; one = parentItem(one)) path.add(one);
  if (isBriefly) for (const one of [...opened]) if (!path.has(one)) fold(one, true);
  const closed = [...path].filter(one => one !== current && !isOpen(one));
  for (const one of closed) {
    fold(one, false);
    if (isBriefly) opened.add(one);
  }
  if (isGraph && closed.length) arrange();
  if (isGraph) centre(current);
  else if (current && current.offsetParent) scrollToRow(current);
}

function scrollToRow(current) {
  const tree = byId("tree"), box = tree.getBoundingClientRect(), row = current.firstChild.getBoundingClientRect();
  const covered = isHeld(current) ? 0 : (Number(current.dataset.held) + 1) * row.height;
  if (row.top < box.top + covered || row.bottom > box.bottom - 40)
    tree.scrollTop += row.top - box.top - Math.max(covered, box.height / 2);
  const name = current.querySelector(".name").getBoundingClientRect();
  if (row.left < box.left || name.right > box.right || name.left > box.left + box.width / 2)
    tree.scrollLeft += row.left - box.left - 24;
  alignRows();
}

// the rows that stay at the top cut none of those below them
function alignRows() {
  const tree = byId("tree"), height = items[0] ? items[0].firstChild.offsetHeight : 0;
  if (isGraph || !height || tree.scrollTop + tree.clientHeight >= tree.scrollHeight - 1) return;
  const aligned = Math.round(tree.scrollTop / height) * height;
  if (Math.abs(aligned - tree.scrollTop) >= 1) tree.scrollTop = aligned;
}

function setFollow(on) {
  follow = on;
  byId("follow").setAttribute("aria-pressed", on);
  if (on) goToTip();
}

// the row that the keyboard meets
function select(one) {
  for (const other of document.querySelectorAll("[role=treeitem][tabindex='0']")) other.tabIndex = -1;
  one.tabIndex = 0;
  reveal(one, false);
}

function focus(one) {
  select(one);
  one.focus({preventScroll: true});
}

// the keys of the ARIA tree pattern; Enter opens the node
function key(event) {
  const one = event.target.closest("[role=treeitem]");
  if (!one || event.ctrlKey || event.altKey || event.metaKey) return;
  const shown = items.filter(other => other && unfoldedOf(other) === other);
  const place = shown.indexOf(one);
  const turn = closed => (foldByHand([one], closed), one);
  const moves = {
    ArrowDown: () => shown[place + 1], ArrowUp: () => shown[place - 1], Home: () => shown[0],
    End: () => shown[shown.length - 1],
    ArrowRight: () => isOpen(one) ? shown[place + 1] : turn(false),
    ArrowLeft: () => isOpen(one) ? turn(true) : parentItem(one),
    " ": () => turn(isOpen(one)),
    Enter: () => void openNode(Number(one.dataset.uid))};
  if (isGraph) Object.assign(moves, {"+": () => void setScale(scale * 1.4), "-": () => void setScale(scale / 1.4), "0": () => void showWhole()});
  if (!(event.key in moves)) return;
  event.preventDefault();
  setFollow(false);
  const next = moves[event.key]();
  if (next) focus(next);
}

function click(event) {
  const row = event.target.closest(".row");
  if (!row) return;
  focus(row.parentElement);
  if (event.target.className === "fold") foldByHand([row.parentElement], isOpen(row.parentElement));
  else openNode(Number(row.parentElement.dataset.uid));
}

// ----------------------------------------------------------------------------------------------------------- search

let matches = [];

function find() {
  const words = byId("find").value.trim().toLowerCase();
  matches = words ? items.filter(one => one && labelOf(nodes[one.dataset.uid - 1]).toLowerCase().includes(words)) : [];
  for (const one of document.querySelectorAll(".match")) one.classList.remove("match");
  for (const one of matches) one.classList.add("match");
  put(byId("matches"), words ? matches.length + " found" : "");
}

function findNext(step) {
  if (!matches.length) return;
  const place = matches.findIndex(one => one.tabIndex === 0);
  setFollow(false);
  if (isGraph && scale < READABLE) setScale(1);
  select(matches[place < 0 ? 0 : (place + step + matches.length) % matches.length]);
}

function findKey(event) {
  if (event.key === "Enter") findNext(event.shiftKey ? -1 : 1);
  else if (event.key === "Escape") {
    byId("find").value = "";
    find();
    const current = document.querySelector("[role=treeitem][tabindex='0']");
    if (current) focus(current);
  } else return;
  event.preventDefault();
  event.stopPropagation();
}

// ------------------------------------------------------------------------------------------------------------ graph

const ROW = 20, INDENT = 15, GAP = 12;   // pixels of a graph at its full size
const LARGEST = 2, READABLE = 0.66;       // scales
let scale = 1;
let extent = {width: 1, height: 1};      // of the graph at its full size
let places = new Map();                  // of its rows: x, y, width

const childrenOf = one => isOpen(one) ? [...one.lastChild.children] : [];

// a node and what is below it, in columns that are at most ``most`` pixels high: the size, and the blocks within
function block(one, most, widths) {
  const made = {one, width: widths.get(one), height: ROW, inner: []};
  let column = null;
  for (const child of childrenOf(one)) {
    const inner = block(child, Math.max(most - ROW, 3 * ROW), widths);
    const isNew = !column || column.height + inner.height > most - ROW;
    if (isNew) column = {x: column ? column.x + column.width + GAP : INDENT, width: 0, height: 0};
    made.inner.push({block: inner, x: column.x, y: ROW + column.height, isAside: isNew && column.x > INDENT});
    column.height += inner.height;
    column.width = Math.max(column.width, inner.width);
    made.width = Math.max(made.width, column.x + column.width);
    made.height = Math.max(made.height, ROW + column.height);
  }
  return made;
}

// place the rows so that all of them are as large as can be in the panel
function arrange() {
  const tree = byId("tree"), shown = items.filter(one => one && unfoldedOf(one) === one);
  if (!shown.length) return;
  const widths = new Map(shown.map(one => [one, one.firstChild.offsetWidth]));
  let best = null, most = 0;
  for (let rows = 6; !best || rows < 1.1 * shown.length; rows = Math.ceil(1.08 * rows)) {
    const made = block(items[0], rows * ROW, widths);
    const fits = Math.min(tree.clientWidth / made.width, tree.clientHeight / made.height);
    if (fits > most) [best, most] = [made, fits];
  }
  extent = {width: best.width, height: best.height};
  places = new Map();
  place(best, 0, 0);
  markTip();
  drawMap();
}

function place(made, x, y) {
  const style = made.one.firstChild.style;
  places.set(made.one, {x, y, width: made.width});
  style.setProperty("--x", x + "px");
  style.setProperty("--y", y + "px");
  for (const inner of made.inner) {
    const line = inner.block.one.firstChild;
    line.style.setProperty("--up", inner.y - ROW / 2 + "px");
    line.style.setProperty("--aside", inner.isAside ? inner.x - INDENT + "px" : "0px");
    place(inner.block, x + inner.x, y + inner.y);
  }
}

// about a place of the panel, else its middle
function setScale(wanted, x = byId("tree").clientWidth / 2, y = byId("tree").clientHeight / 2) {
  const tree = byId("tree"), [left, top] = [(tree.scrollLeft + x) / scale, (tree.scrollTop + y) / scale];
  if (!items[0]) return;
  scale = Math.min(LARGEST, Math.max(Math.min(wholeScale(), 0.3), wanted));
  items[0].style.transform = "scale(" + scale + ")";
  tree.scrollTo(left * scale - x, top * scale - y);
  drawMap();
}

function wholeScale() {
  const tree = byId("tree");
  return Math.min(1.2, tree.clientWidth / extent.width, tree.clientHeight / extent.height);
}

function showWhole() {
  arrange();
  setScale(wholeScale());
}

// into view, and not more than that
function centre(one) {
  const tree = byId("tree"), at = places.get(one);
  if (!at) return;
  const box = one.firstChild.getBoundingClientRect(), panel = tree.getBoundingClientRect();
  if (box.left < panel.left || box.right > panel.right || box.top < panel.top || box.bottom > panel.bottom)
    tree.scrollTo(at.x * scale - tree.clientWidth / 3, at.y * scale - tree.clientHeight / 2);
}

function setGraph(on) {
  isGraph = on;
  document.body.classList.toggle("graph", on);
  document.querySelector(".for-graph").hidden = !on;
  byId("show-graph").setAttribute("aria-pressed", on);
  byId("show-list").setAttribute("aria-pressed", !on);
  if (on) {
    byId("mission-section").scrollIntoView({block: "nearest"});
    showWhole();
    if (scale < READABLE) setScale(1);
  } else if (items[0]) items[0].style.transform = "";
  markTip();
  drawMap();
  if (follow) goToTip();
}

// --------------------------------------------------------------------------------------------------- the small map

const mapScale = () => Math.min(byId("map").width / extent.width, byId("map").height / extent.height);

function drawMap() {
  const map = byId("map"), tree = byId("tree");
  map.hidden = !isGraph || wholeScale() >= scale - 0.01;
  if (map.hidden) return;
  const colours = getComputedStyle(document.body), colour = name => colours.getPropertyValue("--" + name);
  const of = {R: colour("running"), S: colour("success"), F: colour("failure")}, other = colour("wait");
  const pen = map.getContext("2d"), size = mapScale();
  pen.clearRect(0, 0, map.width, map.height);
  for (const [one, at] of places) {
    pen.fillStyle = of[letters[one.dataset.uid - 1]] || other;
    pen.fillRect(at.x * size, at.y * size, Math.max(2, 100 * size), Math.max(1, (ROW - 8) * size));
  }
  pen.strokeStyle = colour("ink");
  pen.lineWidth = 2;
  pen.strokeRect(...[tree.scrollLeft, tree.scrollTop, tree.clientWidth, tree.clientHeight].map(each => each / scale * size));
}

function goByMap(event) {
  if (!event.buttons) return;
  const tree = byId("tree"), size = scale / mapScale() * byId("map").width / byId("map").clientWidth;
  setFollow(false);
  tree.scrollTo(event.offsetX * size - tree.clientWidth / 2, event.offsetY * size - tree.clientHeight / 2);
}

// ------------------------------------------------------------------------------------ one pointer moves, two zoom it

let pointers = new Map();  // those that are down, and where
let hasMoved = false;

function press(event) {
  if (!isGraph) return;
  if (!pointers.size) hasMoved = false;
  pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
}

function move(event) {
  const before = pointers.get(event.pointerId), tree = byId("tree");
  if (!before) return;
  const shift = {x: event.clientX - before.x, y: event.clientY - before.y};
  if (!hasMoved && Math.hypot(shift.x, shift.y) < 4) return;  // a click
  if (!hasMoved) tree.setPointerCapture(event.pointerId);
  hasMoved = true;
  setFollow(false);
  const other = [...pointers.values()].find(each => each !== before), box = tree.getBoundingClientRect();
  if (other) {
    const apart = Math.hypot(before.x - other.x, before.y - other.y);
    setScale(scale * Math.hypot(event.clientX - other.x, event.clientY - other.y) / Math.max(1, apart), other.x - box.left, other.y - box.top);
  } else tree.scrollBy(-shift.x, -shift.y);
  pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
}

const release = event => pointers.delete(event.pointerId);

function wheel(event) {
  setFollow(false);
  if (!isGraph || !event.ctrlKey) return;  // else it scrolls
  event.preventDefault();
  const box = byId("tree").getBoundingClientRect();
  setScale(scale * Math.exp(Math.max(-0.5, Math.min(0.5, -event.deltaY / 300))), event.clientX - box.left, event.clientY - box.top);
}

// --------------------------------------------------------------------------------------------------------- listening

function listenToTree() {
  const on = (id, type, listener, options) => byId(id).addEventListener(type, listener, options);
  on("tree", "keydown", key);
  on("tree", "click", click);
  on("tree", "touchmove", () => setFollow(false), {passive: true});
  on("tree", "wheel", wheel, {passive: false});
  on("tree", "scroll", drawMap);
  on("tree", "scrollend", alignRows);
  on("tree", "pointerdown", press);
  on("tree", "pointermove", move);
  for (const type of ["pointerup", "pointercancel", "pointerleave"]) on("tree", type, release);
  for (const type of ["pointerdown", "pointermove"]) on("map", type, goByMap);
  on("follow", "click", () => setFollow(!follow));
  on("all", "click", () => setAll(!isAll));
  on("unfold", "click", () => foldByHand(items.filter(Boolean), false));
  on("fold", "click", () => foldByHand(items.filter(one => one.classList.contains("subtree")), true));
  on("show-list", "click", () => setGraph(false));
  on("show-graph", "click", () => setGraph(true));
  on("nearer", "click", () => setScale(scale * 1.4));
  on("farther", "click", () => setScale(scale / 1.4));
  on("whole", "click", showWhole);
  on("find", "input", () => { find(); findNext(0); });
  on("find", "keydown", findKey);
  on("help", "click", () => byId("keys").showModal());
  document.addEventListener("keydown", event => {
    if (event.target.closest("input, select") || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "/") byId("find").focus();
    else if (event.key === "?" && !byId("keys").open) byId("keys").showModal();
    else return;
    event.preventDefault();
  });
  addEventListener("resize", () => { if (isGraph) showWhole(); });
  // its size may change later than the window's, and without it
  new ResizeObserver(() => {
    if (follow) goToTip();
    alignRows();
  }).observe(byId("tree"));
}
