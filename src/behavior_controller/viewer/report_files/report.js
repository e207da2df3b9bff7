"use strict";
// Finds sentences in the story, draws the timeline, folds the tree. What is told stands in the page without it.

const data = JSON.parse(byId("data").textContent);

// ----------------------------------------------------------------------------------------------------------------- story

const visits = [...document.querySelectorAll(".visit")];
const sentences = [...document.querySelectorAll(".told li")];

function find() {
  const words = byId("words").value.trim().toLowerCase();
  const [kind, severity, cause] = ["kind", "severity", "cause"].map(id => byId(id).value);
  const isAsked = words + kind + severity + cause !== "";
  let count = 0;
  for (const one of sentences) {
    one.hidden = kind !== "" && one.dataset.kind !== kind || severity !== "" && !one.classList.contains(severity) ||
      cause !== "" && one.dataset.cause !== cause || words !== "" && !one.textContent.toLowerCase().includes(words);
    count += !one.hidden;
  }
  for (const visit of visits) {
    visit.hidden = isAsked && !visit.querySelector(".told li:not([hidden])");
    if (isAsked) visit.open = !visit.hidden;
  }
  byId("story").classList.toggle("found", isAsked);
  byId("found").textContent = isAsked ? count + " of " + sentences.length + " sentences" : sentences.length + " sentences";
}

for (const id of ["words", "kind", "severity", "cause"]) byId(id).addEventListener("input", find);
document.querySelector("form").addEventListener("submit", event => event.preventDefault());

// -------------------------------------------------------------------------------------------------------------- timeline

const NEWEST = 10;    // results of an open node that are shown at first
const timeline = new Timeline(byId("lanes"), data.length, {clock, words: data.words, choose: showDetail, drawn: showRange, above: 2});
timeline.origin = data.began + data.offset;

function clock(time, step = 1000) {
  const text = new Date(data.began + data.offset + time).toISOString();
  return text.slice(11, step < 1000 ? 23 : 19);
}

function barsOf([, ...bars]) {
  return bars.map(([begin, length, letter, count, text]) => (
    {begin, end: begin + length, kind: letter === "-" ? "h" : letter, count, text}));
}

function visitBars() {
  const bars = [];
  for (const [number, began, arrived, ended, outcome] of data.visits) {
    if (arrived > began) bars.push({begin: began, end: arrived, kind: "w", count: 1, text: "", link: "v" + number});
    bars.push({begin: arrived, end: ended, kind: outcome === "-" ? "h" : outcome, count: 1, text: "Visitor " + number, link: "v" + number});
  }
  return bars;
}

function troubleBars() {
  return sentences.filter(one => !one.classList.contains("info")).map((one, place) => {
    one.id = "t" + place;
    const at = Math.max(0, Number(one.dataset.at) * 1000 - data.began);
    return {begin: at, end: at, kind: one.className, count: 1, text: one.querySelector("span").textContent, link: one.id};
  });
}

function makeLanes() {
  const lanes = [{name: "Visits", link: "story", isNamed: true, bars: visitBars()}, {name: "Warnings and errors", link: "story", bars: troubleBars()}];
  for (const numbers of data.lanes) {
    const node = byId("n" + numbers[0]);
    lanes.push({name: node ? node.querySelector(".name").textContent + " " + node.querySelector(".kind").textContent : "Steps",
                link: node ? node.id : "", bars: barsOf(numbers)});
  }
  for (const lane of lanes) lane.bars.sort((one, other) => one.begin - other.begin);
  byId("range").append(new Option("the whole run", ""), ...data.visits.map(visit => new Option("visitor " + visit[0], visit[0])));
  timeline.setLanes(lanes.filter(lane => lane.bars.length));
}

function showDetail(lane, bar, text) {
  byId("detail").replaceChildren(text);
  if (!bar.link || bar.count > 1) return;
  const link = element("a", "", "in the story");
  link.href = "#" + bar.link;
  byId("detail").append(" ", link);
}

function showRange(empty) {
  const {from, to, tick} = timeline;
  if (timeline.isWhole) byId("range").value = "";
  byId("shown").textContent = clock(from, tick) + " to " + clock(to, tick) + ", " + duration(to - from) +
    (empty ? "; " + empty + " lanes have nothing here" : "");
}

function showVisit(number) {
  const visit = data.visits.find(each => String(each[0]) === String(number));
  byId("range").value = visit ? visit[0] : "";
  if (visit) timeline.show(visit[1], visit[3]);
  else timeline.showAll();
}

function listenToTimeline() {
  byId("range").addEventListener("input", () => showVisit(byId("range").value));
  for (const button of document.querySelectorAll("[data-visit]")) button.addEventListener("click", () => {
    showVisit(button.dataset.visit);
    byId("timeline").scrollIntoView();
    byId("lanes").focus({preventScroll: true});
  });
}

// ------------------------------------------------------------------------------------------------------------------ tree

function openable() {
  for (const name of document.querySelectorAll("#tree .name")) {
    const button = element("button", "name", name.textContent);
    button.type = "button";
    button.setAttribute("aria-expanded", "false");
    button.addEventListener("click", () => openNode(button.closest("li"), button.getAttribute("aria-expanded") === "false"));
    name.replaceWith(button);
  }
}

function openNode(item, isOpen) {
  const row = item.firstElementChild, isThere = row.nextElementSibling !== null && row.nextElementSibling.className === "node";
  row.querySelector(".name").setAttribute("aria-expanded", isOpen);
  if (isThere) row.nextElementSibling.hidden = !isOpen;
  else if (isOpen) row.after(nodeElement(Number(item.id.slice(1)), row));
}

function nodeElement(uid, row) {
  const made = element("div", "node"), facts = element("dl"), place = row.querySelector("a"), [type, ports] = data.nodes[uid - 1];
  facts.append(element("dt", "", "type"), element("dd", "", type + (data.types[type] ? ": " + data.types[type] : "")),
               element("dt", "", "in the tree"), element("dd", "", row.title.replace(/\//g, "/\u200b")));
  if (place) {
    const link = element("a", "", place.textContent), where = element("dd");
    link.href = place.href;
    where.append(link);
    facts.append(element("dt", "", "in the file"), where);
  }
  made.append(facts);
  if (ports.length) made.append(portTable(ports));
  made.append(...resultsOf(uid));
  return made;
}

function portTable(ports) {
  const table = element("table"), head = table.createTHead().insertRow(), body = table.createTBody();
  head.append(...["port", "in the file"].map(text => element("th", "", text)));
  for (const [name, text, isWritten] of ports) {
    const line = body.insertRow(), value = element("td", "", isWritten ? text : "");
    if (!isWritten) value.append(element("span", "quiet", "not given, means " + text));
    line.append(element("td", "", name), value);
  }
  return table;
}

// the newest first; the lanes have them all
function resultsOf(uid) {
  const numbers = [...data.lanes, ...data.changes].find(each => each[0] === uid) || [uid];
  const bars = barsOf(numbers).sort((one, other) => other.end - one.end), list = element("ol", "results");
  const add = some => list.append(...some.map(resultElement));
  add(bars.slice(0, NEWEST));
  const found = [element("h3", "", "Results"), list], older = bars.slice(NEWEST);
  if (!bars.length) list.append(element("li", "quiet", "none"));
  if (older.length) {
    const button = element("button", "", "Show " + older.reduce((sum, bar) => sum + bar.count, 0) + " older ones");
    button.type = "button";
    button.addEventListener("click", () => { add(older); button.remove(); });
    found.push(button);
  }
  return found;
}

function resultElement(bar) {
  const made = element("li"), length = bar.end - bar.begin, sign = element("b", bar.kind, data.signs[bar.kind === "h" ? "-" : bar.kind]);
  const took = length < INSTANT ? "at once" : (bar.kind === "n" ? "for " : bar.count > 1 ? "within " : "after ") + duration(length);
  made.append(element("time", "", clock(bar.end)), " ", sign, " " + [
    data.words[bar.kind], bar.kind === "r" ? "" : took, bar.count > 1 ? bar.count + " times" : ""].filter(Boolean).join(" ") +
    (bar.text ? ": " + bar.text : ""));
  const visit = data.visits.find(([, began, , ended]) => began <= bar.end && bar.end <= ended);
  if (visit) {
    const link = element("a", "quiet", "visitor " + visit[0]);
    link.href = "#v" + visit[0];
    made.append(" ", link);
  }
  return made;
}

function foldable() {
  for (const row of document.querySelectorAll("#tree .row")) {
    if (row.nextElementSibling === null) {
      row.classList.add("leaf");
      continue;
    }
    const button = element("button", "fold");
    button.type = "button";
    button.setAttribute("aria-expanded", "true");
    button.setAttribute("aria-label", "Below " + row.querySelector(".name").textContent);
    button.addEventListener("click", () => fold(row.parentElement, !row.parentElement.classList.contains("folded")));
    row.prepend(button);
  }
}

function fold(item, isFolded) {
  item.classList.toggle("folded", isFolded);
  item.querySelector(".fold").setAttribute("aria-expanded", !isFolded);
}

function showAllRows(isOn) {
  byId("tree").classList.toggle("operator", !isOn);
  byId("all").setAttribute("aria-pressed", isOn);
}

// ---------------------------------------------------------------------------------------------------- links and the print

// what a link leads to may be folded, left out by the operator's view, or not found by the search
function reveal() {
  const target = byId(location.hash.slice(1));
  if (!target) return;
  if (target.closest("[hidden]")) {
    document.querySelector("form").reset();
    find();
  }
  if (target.classList.contains("bare")) showAllRows(true);
  for (let outer = target; outer; outer = outer.parentElement) {
    if (outer.tagName === "DETAILS") outer.open = true;
    if (outer !== target && outer.classList.contains("folded")) fold(outer, false);
  }
  if (target.closest("#tree li")) openNode(target, true);
  (target.querySelector(".row") || target).scrollIntoView({block: "center"});
}

addEventListener("hashchange", reveal);
let opened = [];
addEventListener("beforeprint", () => {
  opened = visits.filter(visit => !visit.open);
  for (const visit of opened) visit.open = true;
});
addEventListener("afterprint", () => { for (const visit of opened) visit.open = false; });

foldable();
openable();
showAllRows(false);
byId("all").addEventListener("click", () => showAllRows(byId("all").getAttribute("aria-pressed") !== "true"));
if (visits.length === 1) visits[0].open = true;
makeLanes();
listenToTimeline();
for (const list of document.querySelectorAll(".told")) {
  list.querySelectorAll("a").forEach((one, place) => { one.tabIndex = place ? -1 : 0; });
  walkByArrows(list, "a");
}
find();
reveal();
