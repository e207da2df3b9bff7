"use strict";
// Shows what /events tells: a part of the board arrives whole whenever it has changed.

const SIGNS = {R: "▶", S: "✔", F: "✘", s: "✔", f: "✘", r: "■", "-": "·"};
const WORDS = {R: "running", S: "success", F: "failure", s: "success earlier in this visit",
               f: "failure earlier in this visit", r: "halted", "-": "not yet ticked"};
const EXHIBIT_SIGNS = {"under way": "▶", shown: "✔", "left out": "✘", "broken off": "✘"};
const OUTCOME_SIGNS = {SUCCESS: "✔", FAILURE: "✘"};
let nodes = [];      // as the board tells them, by uid - 1
let items = [];      // the tree's rows by uid - 1; none for nodes that are not shown
let drawn = [];      // the graph's nodes by uid - 1
let letters = "";    // the status of each node, as shown
let tip = 0;         // uid of the running leaf
let follow = true;
let isAll = false;   // also the nodes that only say how the mission is put together
let opened = new Set();  // rows that only the running leaf has unfolded

const LATE = 2;      // seconds without a message after which what is shown may be old; the node sends one every second
const RETRY = 10;    // seconds without a message after which the page connects again
let source = null;
let heard = seconds();    // when the last message came
let lastTry = seconds();
let hasConnection = true;
let alive = {age: null, hangs: false};  // the tick thread's last sign of life, as of the last message
let ended = "";           // how the mission ended
let ages = [];            // elements that show the age of a topic's last message

function seconds() { return performance.now() / 1000; }

// text only where it has changed: what is read aloud is read once
function put(where, text) { if (where.textContent !== text) where.textContent = text; }

// a text that leads to its node, if it has one
function leading(text, uid) {
  if (!uid) return document.createTextNode(text);
  const made = element("a", "", text);
  made.href = "#node-" + uid;
  return made;
}

// ------------------------------------------------------------------------------------------------------------ story

let visit = null;    // the one under way, or the last one
let step = null;     // what is under way; since: when it began, by this page's clock
let steps = [];      // of the visit that ended
let sentences = [];

function showStory(story) {
  visit = story.visit;
  sentences = story.sentences;
  step = story.step && Object.assign({since: seconds() - story.step.age}, story.step);
  put(byId("visitor"), visit ? visitorText() : "No visitor yet");
  put(byId("now"), step ? step.words : "nothing runs");
  showExhibits(visit ? visit.exhibits : []);
  showTranscript(sentences);
  showElapsed();
  showAlarms();
  showTimeline();
}

function visitorText() {
  const current = visit.exhibits.find(each => each.state === "under way");
  return (visit.arrived === null ? "Pass " : "Visitor ") + visit.number + (current ? " · exhibit " + current.number + " of " + current.of + ", " + current.name : "");
}

function showElapsed() {
  const since = step ? Math.max(0, seconds() - step.since) : 0;
  const whole = since.toFixed(0) + " s";
  put(byId("elapsed"), !step ? "" : step.limit ? whole + " of at most " + step.limit + " s" : "for " + whole);
  byId("limit").hidden = !step || !step.limit;
  if (!byId("limit").hidden) {
    byId("limit").max = step.limit;
    byId("limit").value = Math.min(since, step.limit);
  }
}

function showExhibits(exhibits) {
  byId("exhibits").replaceChildren(...exhibits.map(each => {
    const made = element("li", each.state.replace(" ", "-"));
    made.append(element("span", "sign", EXHIBIT_SIGNS[each.state]), " " + each.number + " " + each.name);
    if (each.state === "left out" || each.state === "broken off")
      made.append(": " + each.state + (each.why ? ", " + each.why : ""));
    return made;
  }));
}

// what is new comes first; what the board keeps no more goes
function showTranscript(told) {
  const list = byId("transcript").firstChild;
  const newest = list.firstChild ? Number(list.firstChild.dataset.number) : 0;
  for (const each of told) if (each.number > newest) list.prepend(sentenceItem(each));
  while (list.childElementCount > told.length) list.lastChild.remove();
}

function sentenceItem(told) {
  const made = element("li", told.severity);
  made.dataset.number = told.number;
  const before = byId("transcript").firstChild.firstChild, text = element("span");
  if (before && before.dataset.visit !== String(told.visit)) made.classList.add("begins");
  made.dataset.visit = told.visit;
  text.append(leading(told.text, told.uid));
  made.append(element("time", "", told.time), text);
  return made;
}

function showVisits(visits) {
  const counts = Object.entries(visits.outcomes);
  if (counts.length) put(byId("outcomes"), counts.map(([outcome, count]) => count + " " + outcome).join(", "));
  byId("visits-list").replaceChildren(...visits.newest.map(each => {
    const made = element("li", each.outcome);
    const head = element("span");
    head.append(element("span", "sign", OUTCOME_SIGNS[each.outcome] || "■"), " " + each.told);
    made.append(element("time", "", each.time), head);
    for (const one of each.exhibits)
      if (one.state === "left out")
        made.append(element("span", "why", one.name + ": " + one.state + (one.why ? ", " + one.why : "")));
    return made;
  }));
}

// --------------------------------------------------------------------------------------------------------- timeline

const LANE = 30, AXIS = 46, EDGE = 4;
const MOST_LANES = 24;
let drawnAt = 0, drawnVisit = 0;
const stretch = new Stretch(byId("timeline"), 0, () => {
  const box = byId("timeline").getBoundingClientRect();
  return {left: box.left + EDGE, width: Math.max(200, box.width) - 2 * EDGE};
}, showTimeline);

function shape(tag, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

function showTimeline() {
  drawnAt = seconds();
  const all = step ? steps.concat(Object.assign({seconds: seconds() - step.since}, step)) : steps;
  if (!visit || !all.length) {
    byId("timeline").replaceChildren(element("p", "quiet", "nothing yet"));
    return;
  }
  const bars = all.map(each => ({lane: laneOf(each), words: each.words, isWait: each.is_wait, begin: 1000 * (each.began - visit.began),
                                 end: 1000 * (each.began - visit.began + each.seconds)}));
  seeUntil(Math.max(1000, ...bars.map(each => each.end)));
  const shown = bars.filter(each => each.end >= stretch.from && each.begin <= stretch.to);
  const lanes = [...new Set(bars.map(each => each.lane))].filter(lane => shown.some(each => each.lane === lane)).slice(-MOST_LANES);
  const height = AXIS + lanes.length * LANE;
  const made = shape("svg", {role: "img", viewBox: "0 0 " + (stretch.track().width + 2 * EDGE) + " " + height, "aria-label": "Timeline of visitor "
                     + visit.number + ": " + bars.length + " steps in " + duration(stretch.length)});
  const {scale, tick} = stretch;
  made.append(...axis(scale, tick, height), ...marks(scale));
  lanes.forEach((lane, number) => {
    const y = AXIS + number * LANE;
    made.append(shape("text", {x: EDGE, y: y + 12}, lane));
    made.append(...shown.filter(each => each.lane === lane).map(each => bar(each, scale, y + 16)));
  });
  byId("timeline").replaceChildren(made);
  put(byId("stretch"), sinceBegin(stretch.from, tick) + " to " + sinceBegin(stretch.to, tick));
}

// what was seen up to now goes on to be
function seeUntil(length) {
  if (stretch.isWhole || visit.number !== drawnVisit) [stretch.from, stretch.to] = [0, length];
  else if (stretch.to > stretch.length - 1) [stretch.from, stretch.to] = [stretch.from + length - stretch.length, length];
  stretch.length = length;
  drawnVisit = visit.number;
}

const x = (at, scale) => EDGE + (Math.min(Math.max(at, stretch.from), stretch.to) - stretch.from) * scale;  // pixels

function axis(scale, tick, height) {
  const made = [];
  for (let at = Math.ceil(stretch.from / tick) * tick; at <= stretch.to; at += tick) {
    made.push(shape("line", {x1: x(at, scale), x2: x(at, scale), y1: 14, y2: height}));
    if ((stretch.to - at) * scale > 50) made.push(shape("text", {x: x(at, scale), y: 11, class: "tick"}, sinceBegin(at, tick)));
  }
  return made;
}

// hours, minutes and seconds, as fine as the ticks
function sinceBegin(at, tick) {
  const digits = tick < 100 ? 2 : tick < 1000 ? 1 : 0, whole = Math.round(at / 1000 * 10 ** digits) / 10 ** digits;
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  return (hours ? hours + ":" + String(minutes).padStart(2, "0") : minutes) + ":" + (whole % 60).toFixed(digits).padStart(digits ? 3 + digits : 2, "0");
}

function marks(scale) {
  const made = [];
  for (const told of sentences) {
    const at = 1000 * (told.at - visit.began);
    if (told.visit !== visit.number || told.kind !== "failure" && told.kind !== "recovery" || at < stretch.from || at > stretch.to) continue;
    const mark = shape("text", {x: x(at, scale), y: told.kind === "failure" ? 28 : 41, class: told.kind}, told.kind === "failure" ? "✘" : "↻");
    mark.append(shape("title", {}, told.time + " " + told.text));
    made.push(mark);
  }
  return made;
}

// nodes that do the same have one lane; what only says how the mission is put together is there for a recovery
function laneOf(each) {
  const node = nodes[each.uid - 1];
  return !node ? each.words : node.bare ? "recoveries" : labelOf(node).replace(/ ?#[0-9]+$/, "");
}

function bar(each, scale, y) {
  const left = x(each.begin, scale), width = Math.max(2, x(each.end, scale) - left);
  const made = shape("rect", {x: left, y, width, height: 9, rx: 2, class: each.isWait ? "wait" : "R"});
  made.append(shape("title", {}, each.words + ", " + duration(each.end - each.begin)));
  return made;
}

// ------------------------------------------------------------------------------------------------------------- tree

const DEEPEST = 100;  // nested lists; browsers give up far beyond, so what is deeper stands beside its parent
const MOST_STICKY = 5;

const labelOf = node => node.kind ? node.name + " " + node.kind : node.name;

// a node, or the nearest one above it, that is among those shown (rows or the graph's nodes)
function nearest(uid, shown) {
  let node = nodes[uid - 1];
  while (node && !shown[node.uid - 1]) node = nodes[node.parent - 1];
  return node ? node.uid : 0;
}

const rowOf = uid => items[nearest(uid, items) - 1] || null;
const drawnOf = uid => drawn[nearest(uid, drawn) - 1] || null;

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
  row.append(element("span", "fold"), element("span", "sign", SIGNS["-"]), element("span", "name", node.name));
  if (node.kind) row.append(element("span", "type", node.kind));
  row.addEventListener("click", event => {
    focus(made);
    if (event.target.className === "fold") fold(made, isOpen(made)); else openNode(node.uid);
  });
  made.append(row);
  items[node.uid - 1] = made;
  if (parent) groupFor(parent, level).append(made);
  return made;
}

const isHeld = one => one.classList.contains("sticky");

function groupFor(parent, level) {
  if (level > DEEPEST) return parent.parentElement;
  if (parent.lastChild.getAttribute("role") !== "group") {
    const group = element("ul");
    group.setAttribute("role", "group");
    parent.append(group);
    parent.setAttribute("aria-expanded", parent.classList.contains("subtree") ? "false" : "true");
  }
  return parent.lastChild;
}

function showMission(mission) {
  put(byId("mission"), "Mission " + mission.file.split("/").pop().replace(/\.xml$/, ""));
  document.title = byId("mission").textContent;
  nodes = mission.nodes;
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
  forgetGraph();
  showLetters(known);
}

function setAll(on) {
  isAll = on;
  byId("all").setAttribute("aria-pressed", on);
  showTree();
  if (follow) goToTip();
}

const isOpen = one => one.getAttribute("aria-expanded") === "true";
function fold(one, closed) {
  if (one.hasAttribute("aria-expanded")) one.setAttribute("aria-expanded", closed ? "false" : "true");
  opened.delete(one);
}

function parentItem(one) { return one.parentElement.closest("[role=treeitem]"); }

function showStatuses(statuses) {
  tip = statuses.tip;
  const before = letters;
  showLetters(statuses.letters);
  put(byId("running"), tip && nodes[tip - 1] ? whereabouts(nodes[tip - 1]) : "nothing runs");
  if (follow) goToTip();
  if (opensUid && before[opensUid - 1] !== letters[opensUid - 1]) loadNode();
}

function showLetters(told) {
  for (let place = 0; place < nodes.length; place++) {
    const letter = told[place] || "-";
    if (letters[place] === letter) continue;
    mark(items[place], letter, nodes[place]);
    mark(drawn[place], letter, nodes[place]);
  }
  letters = told;
  for (const one of document.querySelectorAll(".tip")) one.classList.remove("tip");
  const current = rowOf(tip);
  if (current) current.classList.add("tip");
  if (current && current !== items[tip - 1] && follow && !isOpen(current)) { fold(current, false); opened.add(current); }
  if (drawnOf(tip)) drawnOf(tip).classList.add("tip");
}

function mark(one, letter, node) {
  if (!one) return;
  one.classList.remove("R", "S", "F", "s", "f", "r");
  if (letter !== "-") one.classList.add(letter);
  one.setAttribute("aria-label", labelOf(node) + ": " + WORDS[letter]);
  const sign = one.querySelector(".row > .sign");
  if (sign) sign.textContent = SIGNS[letter];
  else one.querySelector("text").textContent = (letter === "-" ? "" : SIGNS[letter] + " ") + one.dataset.label;
}

// the subtrees around a node, and the node itself
function whereabouts(node) {
  const around = [labelOf(node)];
  for (let outer = nodes[node.parent - 1]; outer; outer = nodes[outer.parent - 1]) if (outer.subtree) around.unshift(outer.name);
  return around.join(" › ");
}

function goToTip() {
  const current = rowOf(tip);
  if (!byId("graph").hidden) centre(tip);
  reveal(current, true);
}

// unfold what is around a row, and scroll there inside the tree
function reveal(current, isBriefly) {
  const path = new Set();
  for (let one = current; one; one = parentItem(one)) path.add(one);
  if (isBriefly) for (const one of [...opened]) if (!path.has(one)) fold(one, true);
  for (const one of path) if (one !== current && !isOpen(one)) { fold(one, false); if (isBriefly) opened.add(one); }
  if (!current || !current.offsetParent) return;
  const tree = byId("tree"), box = tree.getBoundingClientRect(), row = current.firstChild.getBoundingClientRect();
  const covered = isHeld(current) ? 0 : (Number(current.dataset.held) + 1) * row.height;
  if (row.top < box.top + covered || row.bottom > box.bottom - 40)
    tree.scrollTop += row.top - box.top - Math.max(covered, box.height / 2);
  const name = current.querySelector(".name").getBoundingClientRect();
  if (row.left < box.left || name.right > box.right || name.left > box.left + box.width / 2)
    tree.scrollLeft += row.left - box.left - 24;
}

function setFollow(on) {
  follow = on;
  byId("follow").setAttribute("aria-pressed", on);
  if (on) goToTip();
}

function focus(one) {
  for (const other of document.querySelectorAll("[role=treeitem][tabindex='0']")) other.tabIndex = -1;
  one.tabIndex = 0;
  one.focus({preventScroll: true});
  reveal(one, false);
}

// the keys of the ARIA tree pattern; Enter opens the node
function key(event) {
  const one = event.target.closest("[role=treeitem]");
  if (!one || event.ctrlKey || event.altKey || event.metaKey) return;
  const shown = items.filter(other => other && other.offsetParent !== null);
  const place = shown.indexOf(one);
  const moves = {
    ArrowDown: () => shown[place + 1], ArrowUp: () => shown[place - 1], Home: () => shown[0],
    End: () => shown[shown.length - 1],
    ArrowRight: () => isOpen(one) ? shown[place + 1] : (fold(one, false), one),
    ArrowLeft: () => isOpen(one) ? (fold(one, true), one) : parentItem(one),
    " ": () => (fold(one, isOpen(one)), one)};
  if (event.key === "Enter") {
    event.preventDefault();
    openNode(Number(one.dataset.uid));
    return;
  }
  if (!(event.key in moves)) return;
  event.preventDefault();
  setFollow(false);
  const next = moves[event.key]();
  if (next) focus(next);
}

// --------------------------------------------------------------------------------------------------------- one node

let opensUid = 0;    // the node that is open
let isLoading = false;

function openNode(uid) {
  if (!nodes[uid - 1]) return;
  opensUid = uid;
  setFollow(false);
  reveal(rowOf(uid), false);
  byId("node").hidden = false;
  put(byId("node-title"), labelOf(nodes[uid - 1]));
  byId("node-title").focus({preventScroll: true});
  byId("node").scrollIntoView({block: "nearest"});
  loadNode();
}

function closeNode() {
  const row = rowOf(opensUid);
  opensUid = 0;
  if (byId("node").contains(document.activeElement) && row) focus(row);
  byId("node").hidden = true;
  if (location.hash) history.replaceState(null, "", location.pathname);
}

async function loadNode() {
  if (isLoading) return;
  isLoading = true;
  try {
    const answer = await fetch("node/" + opensUid);
    const found = answer.ok ? await answer.json() : null;
    if (found && found.uid === opensUid) showNode(found);
  } catch (error) {
    // the connection is lost: the head of the page says so
  } finally {
    isLoading = false;
  }
}

function showNode(found) {
  const facts = [["type", found.type + (found.description ? ": " + found.description : "")], ["in the tree", found.path.replace(/\//g, "/\u200b")],
                 ["in the file", found.place.split("/").pop()], ["now", WORDS[letters[found.uid - 1]]]];
  byId("facts").title = found.place;
  byId("facts").replaceChildren(...facts.filter(each => each[1]).flatMap(
    ([name, text]) => [element("dt", "", name), element("dd", "", text)]));
  fillTable("ports", found.ports.map(port => [port.name, port.text, port.value]));
  byId("results").replaceChildren(...found.results.map(each => element("li", "", [
    each.time, SIGNS[each.letter === "-" ? "r" : each.letter], WORDS[each.letter === "-" ? "r" : each.letter],
    1000 * each.seconds < INSTANT ? "at once" : "after " + duration(1000 * each.seconds),
    each.times > 1 ? each.times + " times in a row" : "",
    each.why].filter(Boolean).join(" "))));
  if (!found.results.length) byId("results").append(element("li", "quiet", "none yet"));
}

function fillTable(id, rows) {
  byId(id).tBodies[0].replaceChildren(...rows.map(row => {
    const made = element("tr");
    made.append(...row.map(text => element("td", "", text)));
    return made;
  }));
  if (!rows.length) {
    const none = element("tr");
    none.append(element("td", "quiet", "none"));
    byId(id).tBodies[0].append(none);
  }
}

function openByHash() {
  const found = /^#node-([0-9]+)$/.exec(location.hash);
  if (found) openNode(Number(found[1]));
}

// ------------------------------------------------------------------------------------------------------------ graph

const NEAREST = 60;  // units of the drawing across the view
let view = null;     // what is seen of the drawing: x, y, width, height
let full = null;     // all of it
let pointers = new Map();  // those that are down, and where
let hasMoved = false;

function forgetGraph() {
  drawn = [];
  full = null;
  byId("graph").replaceChildren();
  if (!byId("graph").hidden) loadGraph();
}

async function loadGraph() {
  if (full || !nodes.length) return;
  const waiting = element("p", "quiet", "graphviz draws…");
  byId("graph").replaceChildren(waiting);
  let drawing;
  try {
    const answer = await fetch(isAll ? "graph.svg" : "graph-operator.svg"), text = await answer.text();
    if (!answer.ok) throw new Error(text);
    drawing = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
  } catch (error) {
    drawing = element("p", "quiet", "No graph: " + error.message);
  }
  if (!waiting.isConnected) return;  // another one has been asked for
  if (drawing.tagName === "svg") showGraph(drawing);
  else byId("graph").replaceChildren(drawing);
}

function showGraph(svg) {
  const box = svg.viewBox.baseVal;
  full = {x: box.x, y: box.y, width: box.width, height: box.height};
  for (const name of ["width", "height"]) svg.removeAttribute(name);
  svg.setAttribute("role", "group");
  svg.setAttribute("aria-label", "Graph of the mission: arrow keys walk, + and − zoom, Enter opens a node");
  for (const title of svg.querySelectorAll("title")) title.remove();
  for (const group of svg.querySelectorAll(".node")) prepare(group);
  byId("graph").replaceChildren(document.adoptNode(svg));
  const shown = letters;
  letters = "";
  showLetters(shown);
  if (drawn[0]) drawn[0].tabIndex = 0;
  seeWhole();
  if (follow) centre(tip);
}

// the label ends with the node's number; the root has the mission's name
function prepare(group) {
  const label = group.querySelector("text").textContent;
  const uid = Number((/#([0-9]+)$/.exec(label) || [0, 1])[1]);
  group.dataset.uid = uid;
  group.dataset.label = label;
  group.setAttribute("role", "button");
  group.setAttribute("tabindex", "-1");
  drawn[uid - 1] = group;
}

function see(box) {
  view = box;
  byId("graph").firstChild.setAttribute("viewBox", [box.x, box.y, box.width, box.height].join(" "));
}

function seeWhole() { if (full) see(Object.assign({}, full)); }

// zoom about a place of the view, given as shares of its width and height
function zoom(factor, across = 0.5, down = 0.5) {
  if (!full) return;
  const width = Math.min(full.width * 1.5, Math.max(NEAREST, view.width * factor)), height = view.height * width / view.width;
  see({x: view.x + (view.width - width) * across, y: view.y + (view.height - height) * down, width, height});
}

const READABLE = 1.35;  // pixels for a unit of the drawing, whose letters are 9 units high

function centre(uid) {
  const group = drawnOf(uid);
  if (!group || !full) return;
  const panel = byId("graph"), box = group.getBBox(), matrix = group.parentNode.transform.baseVal.consolidate().matrix;
  const width = Math.min(view.width, panel.clientWidth / READABLE), height = width * panel.clientHeight / panel.clientWidth;
  const within = (middle, size, from, whole) => size > whole ? from + (whole - size) / 2 : Math.min(Math.max(middle - size / 2, from), from + whole - size);
  see({x: within(box.x + box.width / 2 + matrix.e, width, full.x, full.width),
       y: within(box.y + box.height / 2 + matrix.f, height, full.y, full.height), width, height});
}

function graphKey(event) {
  if (!full || event.ctrlKey || event.altKey || event.metaKey) return;
  const uid = Number((event.target.closest(".node") || {dataset: {uid: 1}}).dataset.uid);
  const above = nearest(nodes[uid - 1].parent, drawn);
  const below = of => nodes.filter(node => drawn[node.uid - 1] && nearest(node.parent, drawn) === of).map(node => node.uid);
  const siblings = below(above);
  const moves = {ArrowUp: above, ArrowDown: below(uid)[0], ArrowLeft: siblings[siblings.indexOf(uid) - 1],
                 ArrowRight: siblings[siblings.indexOf(uid) + 1], Home: 1};
  if (event.key in moves) {
    setFollow(false);
    walk(moves[event.key]);
  } else if (event.key === "+") zoom(0.7);
  else if (event.key === "-") zoom(1.4);
  else if (event.key === "Enter" || event.key === " ") openNode(uid);
  else return;
  event.preventDefault();
}

function walk(uid) {
  if (!drawn[uid - 1]) return;
  for (const other of drawn) if (other) other.setAttribute("tabindex", "-1");
  drawn[uid - 1].setAttribute("tabindex", "0");
  drawn[uid - 1].focus({preventScroll: true});
  centre(uid);
}

function press(event) {
  if (!full) return;
  if (!pointers.size) hasMoved = false;
  pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
}

// one pointer moves the drawing, two zoom it
function move(event) {
  const before = pointers.get(event.pointerId);
  if (!before || !full) return;
  const box = byId("graph").getBoundingClientRect(), others = [...pointers.values()].filter(each => each !== before);
  const shift = {x: event.clientX - before.x, y: event.clientY - before.y};
  if (!hasMoved && Math.hypot(shift.x, shift.y) < 4) return;  // a click
  if (!hasMoved) byId("graph").setPointerCapture(event.pointerId);
  hasMoved = true;
  setFollow(false);
  const unit = Math.max(view.width / box.width, view.height / box.height);
  if (others.length) {
    const other = others[0], apart = Math.hypot(before.x - other.x, before.y - other.y);
    zoom(apart / Math.max(1, Math.hypot(event.clientX - other.x, event.clientY - other.y)),
         (other.x - box.left) / box.width, (other.y - box.top) / box.height);
  } else see({x: view.x - shift.x * unit, y: view.y - shift.y * unit, width: view.width, height: view.height});
  pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
}

function release(event) { pointers.delete(event.pointerId); }

function wheel(event) {
  if (!full) return;
  event.preventDefault();
  setFollow(false);
  const box = byId("graph").getBoundingClientRect();
  zoom(Math.exp(Math.max(-0.5, Math.min(0.5, event.deltaY / 300))), (event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
}

function setGraph(on) {
  byId("graph").hidden = !on;
  byId("tree").hidden = on;
  document.querySelector(".for-graph").hidden = !on;
  document.querySelector(".for-list").hidden = on;
  byId("show-graph").setAttribute("aria-pressed", on);
  byId("show-list").setAttribute("aria-pressed", !on);
  if (on) loadGraph();
  if (follow) goToTip();
}

// --------------------------------------------------------------------------------------------------------- the rest

const MOST_ALARMS = 3;  // at the top of the page; all stand below
let ill = [];

function showPasses(passes) { ended = passes.ended; }

// what is wrong with the robot, and what a visit could not go on with, until the next visitor comes
function showAlarms() {
  const first = !visit ? 0 : visit.arrived === null ? visit.number - 1 : visit.number;
  const given = sentences.filter(told => told.visit >= first && told.severity === "error" && told.kind !== "health");
  const alarms = ill.map(part => ({text: part.told || part.name + ": " + part.status + "; " + part.consequence, uid: 0}))
    .concat(given.slice().reverse());
  const shown = alarms.slice(0, MOST_ALARMS).map(alarm => {
    const made = element("li", "", "✘ ");
    made.append(leading(alarm.text, alarm.uid));
    return made;
  });
  if (alarms.length > MOST_ALARMS) shown.push(element("li", "", "and " + (alarms.length - MOST_ALARMS) + " more"));
  byId("alarms").replaceChildren(...shown);
}

function showHealth(parts) {
  ages = [];
  ill = parts.filter(part => !part.well);
  showAlarms();
  byId("health").replaceChildren(...parts.map(part => {
    const made = element("li", part.well ? "well" : "ill");
    made.append(element("span", "sign", part.well ? "✔" : "✘"), element("span", "name", part.name));
    if (part.calls)
      made.append(element("span", "calls", part.calls + " calls, " + part.failures + " failed, last " + part.seconds + " s"));
    if (part.age !== null) {
      const age = element("span", "calls");
      ages.push({element: age, since: seconds() - part.age});
      made.append(age);
    }
    if (part.status && !part.well) made.append(element("span", "", part.status + "; " + part.consequence));
    return made;
  }));
}

const SHOW = {mission: showMission, statuses: showStatuses, passes: showPasses, timeline: part => { steps = part.steps; },
              story: showStory, visits: showVisits, health: showHealth, blackboard: entries => fillTable("blackboard", entries),
              alive: part => { alive = part; }};

// -------------------------------------------------------------------------------------------------- is it still so?

// what is shown is as old as the last message, whatever it says: the page counts by itself
function showDoubt() {
  const silent = seconds() - heard;
  let text = "", age = null, state = "live";
  if (ended) [text, state] = ["The mission has ended: " + ended + ".", "ended"];
  else if (!hasConnection) [text, age, state] = ["The connection to the mission is lost; trying again. What is shown is old.", silent, "lost"];
  else if (silent >= LATE) [text, age, state] = ["No message from the mission. What is shown may be old.", silent, "late"];
  else if (alive.hangs) [text, age, state] = ["The controller hangs: its tick thread gives no sign of life.", alive.age + silent, "hangs"];
  const [alert, since] = byId("doubt").children;
  put(alert, text);
  put(since, age === null ? "" : "Since " + new Date(Date.now() - 1000 * age).toTimeString().slice(0, 8) + ", " + age.toFixed(0) + " s ago.");
  put(byId("connection"), state);
  byId("doubt").classList.toggle("told", text !== "");
  document.body.classList.toggle("stale", age !== null);
  document.body.classList.toggle("ended", ended !== "");
  for (const each of ages) each.element.textContent = "last message " + (seconds() - each.since).toFixed(1) + " s ago";
  if (age === null && !ended) showElapsed();
  if (age === null && !ended && seconds() - drawnAt >= 1) showTimeline();
  if (silent >= RETRY && seconds() - lastTry >= RETRY) connect();
}

function connect() {
  if (source) source.close();
  lastTry = seconds();
  source = new EventSource("events");
  source.onmessage = event => {
    const parts = JSON.parse(event.data);
    heard = seconds();
    hasConnection = true;
    for (const name of Object.keys(SHOW)) if (name in parts) SHOW[name](parts[name]);
    if ("mission" in parts) openByHash();
    showDoubt();
  };
  source.onerror = () => {
    hasConnection = false;
    showDoubt();
  };
}

const on = (id, type, listener, options) => byId(id).addEventListener(type, listener, options);
on("tree", "keydown", key);
for (const type of ["wheel", "touchmove"]) on("tree", type, () => setFollow(false), {passive: true});
on("graph", "keydown", graphKey);
on("graph", "wheel", wheel, {passive: false});
on("graph", "pointerdown", press);
on("graph", "pointermove", move);
for (const type of ["pointerup", "pointercancel", "pointerleave"]) on("graph", type, release);
on("graph", "click", event => {
  const group = event.target.closest(".node");
  if (group && !hasMoved) openNode(Number(group.dataset.uid));
});
on("follow", "click", () => setFollow(!follow));
on("all", "click", () => setAll(!isAll));
on("unfold", "click", () => { setFollow(false); items.forEach(one => fold(one, false)); });
on("fold", "click", () => { setFollow(false); items.forEach(one => fold(one, one.classList.contains("subtree"))); });
on("show-list", "click", () => setGraph(false));
on("show-graph", "click", () => setGraph(true));
on("nearer", "click", () => { setFollow(false); zoom(0.7); });
on("farther", "click", () => { setFollow(false); zoom(1.4); });
on("whole", "click", () => { setFollow(false); seeWhole(); });
on("whole-visit", "click", () => stretch.showAll());
on("close", "click", closeNode);
document.addEventListener("keydown", event => { if (event.key === "Escape" && opensUid) closeNode(); });
addEventListener("hashchange", openByHash);
addEventListener("resize", showTimeline);
connect();
setInterval(showDoubt, 250);
