"use strict";
// Shows what /events tells: first all parts of the board, then those that have changed.

const NODE = "node-";  // what an id of a node begins with
const LATE = 2;      // seconds without a message after which what is shown may be old; the node sends one every second
const KEPT = 60;     // seconds for which the header keeps the height that an instruction took
const RETRY = 10;    // seconds without a message after which the page connects again
let source = null;
let heard = seconds();    // when the last message came
let lastTry = seconds();
let hasConnection = true;
let alive = {age: null, hangs: false};  // the tick thread's last sign of life, as of the last message
let parts = {};           // of the board, as of the last message
let steps = [];           // of the visit that ended
let step = null;          // the one on the card
let values = {lanes: [], left_out: 0};  // of the visit
let tallest = {height: 0, at: 0};  // of the header's part for the robot, and when it took that height
let measured = null;      // what it said when its height was last asked for
let hasBegun = null;      // whether a pass has, when the list of what is ready was shown last
let ages = [];            // elements that show the age of a topic's last message

function showVisits(visits) {
  put(byId("outcomes"), visits.counted);
  byId("visits-list").replaceChildren(...visits.newest.slice().reverse().map(each => {
    const made = element("li"), head = element("span");
    head.append(sign(each.result), " " + each.ending);
    made.append(element("time", "", each.time), head);
    for (const one of each.stops)
      if (one.state === "left out")
        made.append(element("span", "why", one.name + ": " + one.state + (one.why ? ", " + one.why : "")));
    return made;
  }));
}

// --------------------------------------------------------------------------------------------------------- timeline

const MARKS = {failure: "error", recovery: "r"};
let drawnAt = 0, drawnVisit = 0;
const timeline = new Timeline(byId("lanes"), 0, {
  clock: sinceBegin, least: 80, words: {R: "", F: "failed", w: "waited", error: "failure", r: "recovery", v: ""},
  choose: (lane, bar) => travel(visit.began + bar.begin / 1000),
  drawn: () => put(byId("stretch"), sinceBegin(timeline.from, timeline.tick) + " to " + sinceBegin(timeline.to, timeline.tick) +
    (values.left_out ? "; " + values.left_out + " more entries stand in the blackboard alone" : ""))});

function showTimeline() {
  drawnAt = seconds();
  if (!visit) return;
  const all = step ? steps.concat(Object.assign({seconds: Math.max(0, nodeTime() - step.began)}, step)) : steps, lanes = new Map();
  const add = (lane, began, length, kind, text) => {
    const begin = 1000 * (began - visit.began);
    if (!lanes.has(lane)) lanes.set(lane, {name: lane, bars: []});
    lanes.get(lane).bars.push({begin, end: begin + 1000 * length, kind, count: 1, text});
  };
  for (const sentence of sentences)
    if (sentence.visit === visit.number && sentence.kind in MARKS) add("Failures", sentence.at, 0, MARKS[sentence.kind], sentence.text);
  for (const each of all) add(laneOf(each), each.began, each.seconds, each.failed ? "F" : each.is_wait ? "w" : "R", each.words);
  const changes = values.lanes.map(lane => 1000 * (lane.changes[lane.changes.length - 1][0] - visit.began));
  const length = Math.max(1000, ...changes, ...[...lanes.values()].flatMap(lane => lane.bars.map(bar => bar.end)));
  seeUntil(length);
  timeline.setLanes([...values.lanes.map(({name, changes}) => valueLane(name, changes.map(([at, text]) => [1000 * (at - visit.began), text]), length)),
                     ...lanes.values()]);
  if (step && follow && timeline.isWhole) keepInView(lanes.get(laneOf(step)).row);
}

function keepInView(row) {
  const box = byId("lanes"), above = row.offsetTop - timeline.axis.offsetHeight - timeline.values.offsetHeight, below = row.offsetTop + row.offsetHeight;
  if (above < box.scrollTop || below > box.scrollTop + box.clientHeight) box.scrollTop = below - box.clientHeight;
}

// what was seen up to now goes on to be
function seeUntil(length) {
  if (timeline.isWhole || visit.number !== drawnVisit) [timeline.from, timeline.to] = [0, length];
  else if (timeline.to > timeline.length - 1) [timeline.from, timeline.to] = [timeline.from + length - timeline.length, length];
  timeline.length = length;
  drawnVisit = visit.number;
}

// hours, minutes and seconds, as fine as the ticks
function sinceBegin(at, tick) {
  const digits = tick < 100 ? 2 : tick < 1000 ? 1 : 0, whole = Math.round(at / 1000 * 10 ** digits) / 10 ** digits;
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  return (hours ? hours + ":" + String(minutes).padStart(2, "0") : minutes) + ":" + (whole % 60).toFixed(digits).padStart(digits ? 3 + digits : 2, "0");
}

// nodes that do the same have one lane; what only says how the mission is put together is there for a recovery
function laneOf(each) {
  const node = nodes[each.uid - 1];
  return !node ? each.words : node.bare ? "recoveries" : labelOf(node).replace(/ ?#[0-9]+$/, "");
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
  fillTable("ports", found.ports.map(port => [port.name, port.text, frozen === null ? port.value : ""]));
  byId("results").replaceChildren(...found.results.map(each => element("li", "", [
    each.time, SIGNS[each.letter === "-" ? "r" : each.letter], WORDS[each.letter === "-" ? "r" : each.letter],
    1000 * each.seconds < INSTANT ? "at once" : "after " + duration(1000 * each.seconds),
    each.times > 1 ? each.times + " times in a row" : "",
    each.why].filter(Boolean).join(" "))));
  if (frozen !== null) byId("results").replaceChildren(element("li", "quiet", "shown for now only: press Live"));
  else if (!found.results.length) byId("results").append(element("li", "quiet", "none yet"));
}

function openByHash() {
  const found = new RegExp("^#" + NODE + "([0-9]+)$").exec(location.hash);
  if (found) openNode(Number(found[1]));
}

// --------------------------------------------------------------------------------------------------------- the rest

let ill = [];

// the newest thing that is wrong: with the robot, or that a visit could not go on with, until the next visitor comes
function showAlarms() {
  const first = !visit ? 0 : visit.arrived === null ? visit.number - 1 : visit.number;
  const given = sentences.filter(row => row.visit >= first && row.severity === "error" && row.kind !== "health");
  const alarms = ill.map(part => ({text: part.trouble, uid: 0})).concat(given.slice().reverse());
  byId("alarms").replaceChildren(...alarms.slice(0, 1).map(alarm => {
    const made = element("li", "", "✘ ");
    made.append(leading(alarm.text, alarm.uid));
    made.title = alarms.map(each => each.text).join("\n");
    if (alarms.length > 1) made.append(" (and " + (alarms.length - 1) + " more)");
    return made;
  }));
}

function showHealth(offers) {
  ages = [];
  const all = Object.values(offers).filter(Boolean);
  ill = all.filter(part => !part.well).sort((one, other) => one.rank - other.rank);
  showAlarms();
  byId("health").replaceChildren(...all.map(part => {
    const made = element("li", part.well ? "well" : "ill");
    made.append(element("span", "sign", part.well ? "✔" : "✘"), element("span", "name", part.name));
    if (part.calls)
      made.append(element("span", "calls", part.calls + (part.calls > 1 ? " calls, " : " call, ") + part.failures + " failed, last " + part.seconds + " s"));
    if (part.age !== null) {
      const age = element("span", "calls");
      ages.push({element: age, since: seconds() - part.age});
      made.append(age);
    }
    if (part.status && !part.well) made.append(element("span", "", part.status + "; " + part.consequence));
    return made;
  }));
}

function showStep(now) {
  travels.end = now.card.kind === "ended" ? now.card.since + 0.001 : 0;  // a run that is over stands there
  showNow(now);
  keepHeight();
  const isStep = ["step", "wait", "retry", "paused"].includes(card.kind);
  step = isStep ? {words: card.what, began: card.since, uid: card.uid, is_wait: card.kind !== "step"} : null;
}

// what a person has to do moves the page below it once if it needs more lines than are kept for it, not to and fro; a header that
// takes half of the window scrolls with the page
function keepHeight() {
  const head = byId("head"), text = byId("instruction").textContent + byId("safe").textContent, header = document.querySelector("header");
  if (text === measured && seconds() - tallest.at < KEPT) return;
  measured = text;
  head.style.minHeight = "";
  if (head.offsetHeight >= tallest.height || seconds() - tallest.at > KEPT) tallest = {height: head.offsetHeight, at: seconds()};
  else head.style.minHeight = tallest.height + "px";
  header.classList.toggle("tall", header.offsetHeight > innerHeight / 2);
}

// in this order: what is shown first is there for what follows
const READY_SIGNS = {missing: "✘", awaited: "…", doubtful: "!", untried: "○", ready: "✔"};  // in the order of their urgency
const URGENT = ["missing", "awaited", "doubtful"];

// open until the mission begins; then what is not ready alone opens it
function showReady(ready) {
  const counts = {}, box = byId("ready").querySelector("details");
  for (const row of ready.rows) counts[row.state] = (counts[row.state] || 0) + 1;
  const isOver = parts.now.ended !== "" && (visit !== null || ready.rows.every(row => row.kind === "run"));  // the card says it
  byId("ready").hidden = isOver || !ready.rows.length;
  put(byId("ready-title"), ready.is_ready ? "Ready" : "Not ready");
  put(byId("ready-summary"), Object.entries(counts).map(([state, count]) => count + " " + state).join(", "));
  byId("ready").classList.toggle("not", !ready.is_ready);
  if (hasBegun !== (visit !== null)) {
    hasBegun = visit !== null;
    box.open = !hasBegun;
  }
  const urgency = row => (URGENT.indexOf(row.state) + URGENT.length + 1) % (URGENT.length + 1);
  byId("ready-list").replaceChildren(...ready.rows.slice().sort((one, other) => urgency(one) - urgency(other)).map(row => {
    const made = element("li", row.state), mark = element("span", "sign", READY_SIGNS[row.state]);
    mark.setAttribute("role", "img");
    mark.setAttribute("aria-label", row.state);
    made.append(mark, breakable(element("span", "what"), row.kind + " " + row.name), breakable(element("span"), row.text));
    return made;
  }));
}

const SHOW = {
  alive: part => { alive = part; [ahead, shift] = [part.at - seconds(), part.clock_shift]; }, mission: showMission, statuses: showStatuses,
  now: showStep, story: story => { showStory(story); showAlarms(); }, timeline: part => { steps = part; }, values: part => { values = part; },
  visits: showVisits, ready: showReady, health: showHealth, blackboard: showBlackboard};

function show(news, all) {
  for (const name of Object.keys(SHOW)) if (name in news) SHOW[name](all[name]);
  if (["now", "story", "timeline", "values"].some(name => name in news)) showTimeline();
}

// -------------------------------------------------------------------------------------------------- is it still so?

// what is shown is as old as the last message, whatever it says: the page counts by itself
function showDoubt() {
  const silent = seconds() - heard;
  let text = "", age = null, state = "live";
  const ended = parts.now ? parts.now.ended : "";
  if (ended) [text, state] = ["The mission has ended" + (card.kind === "ended" ? "" : ": " + ended) + ".", "ended"];  // the card says how
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
  if (frozen === null) showNowOnScrubber();
  if (age === null && !ended && seconds() - drawnAt >= 1) showTimeline();
  if (silent >= RETRY && seconds() - lastTry >= RETRY) connect();
}

function showNowOnScrubber() {
  if (alive.kept) [byId("scrub").min, byId("scrub").max] = [alive.kept, nodeTime()];
  showMoment();
}

function connect() {
  if (source) source.close();
  lastTry = seconds();
  source = new EventSource("events");
  source.onopen = () => { parts = {}; };
  source.onmessage = event => {
    const news = JSON.parse(event.data);
    Object.assign(parts, news);
    heard = seconds();
    hasConnection = true;
    document.body.classList.remove("waiting");
    if (frozen === null) show(news, parts);
    else if ("mission" in news && JSON.stringify(parts.mission.nodes) !== JSON.stringify(nodes)) live();  // another mission, which has no such moment
    else if ("alive" in news) SHOW.alive(parts.alive);
    if ("mission" in news) openByHash();
    showDoubt();
  };
  source.onerror = () => {
    hasConnection = false;
    showDoubt();
  };
}

travels = {
  stretch: async at => [[at, await (await fetch("at/" + (at + 1e-6).toFixed(6))).json()]], show: found => show(found, found),
  live: () => show(parts, parts)};

listenToTree();
const on = (id, type, listener) => byId(id).addEventListener(type, listener);
on("whole-visit", "click", () => timeline.showAll());
on("close", "click", closeNode);
listenToScrubber();
document.addEventListener("keydown", event => { if (event.key === "Escape" && opensUid) closeNode(); });
addEventListener("hashchange", openByHash);
addEventListener("resize", () => { [measured, tallest] = [null, {height: 0, at: 0}]; keepHeight(); });
connect();
setInterval(showDoubt, 250);
