// A moment of the recorded run: what was so then is unpacked from the page, and shown with the tree and the timeline.

const NODE = "n";  // what an id of a node begins with
const MOST_SENTENCES = 100;
const rows = new Map([...document.querySelectorAll("#tree li[id]")].map(one => [Number(one.id.slice(1)), one]));
const end = (data.began + data.length) / 1000;
let letters = "";
let stretchOfMoments = {number: -1, moments: []};

spoken = data.language;
timeOfDay = at => clock(1000 * at - data.began);

async function stretchAt(at) {
  const number = Math.max(0, data.moments.filter(([began]) => began <= at).length - 1);
  if (stretchOfMoments.number !== number) stretchOfMoments = {number, moments: await unpacked(data.moments[number][1])};
  return stretchOfMoments.moments;
}

async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
}

function showStatuses({letters: shown, tip}) {
  for (const [uid, row] of rows) {
    const letter = shown[uid - 1] || "-";
    if (letters[uid - 1] !== letter) showStatus(row, letter);
    row.classList.toggle("tip", uid === tip);
  }
  letters = shown;
}

function showStatus(row, letter) {
  let mark = row.querySelector(":scope > .row > .then");
  if (!mark) {
    mark = element("span", "");
    row.firstElementChild.querySelector(".name").before(mark);
  }
  mark.className = "then " + letter;
  mark.textContent = SIGNS[letter];
  mark.title = WORDS[letter];
}

// those up to the moment
function sentencesUntil(at) {
  const sentences = [...document.querySelectorAll(".told li")].filter(one => Number(one.dataset.at) <= at + 0.001);
  return sentences.map((one, place) => ({
    number: place + 1, at: Number(one.dataset.at), time: one.querySelector("time").textContent, severity: one.className,
    text: one.querySelector("span").textContent, kind: one.dataset.kind, visit: one.closest(".visit").id.slice(1),
    incident: Number(one.dataset.incident || 0),
    uid: Number((one.querySelector("a[href^='#n']") || {hash: "#n0"}).hash.slice(2))})).slice(-MOST_SENTENCES);
}

function drawCursor() {
  let cursor = document.querySelector("#lanes .cursor");
  if (!cursor) cursor = element("div", "cursor");
  byId("lanes").append(cursor);
  const at = 1000 * nodeTime() - data.began;
  cursor.hidden = at < timeline.from || at > timeline.to;
  cursor.style.setProperty("--at", (at - timeline.from) / (timeline.to - timeline.from));
}

travels = {
  end, stretch: stretchAt, live: () => travel(end),
  show: parts => {
    showStatuses(parts.statuses);
    showNow(parts.now);
    showStory({visit: parts.story.visit, sentences: sentencesUntil(nodeTime())});
    showBlackboard(parts.blackboard);
    drawCursor();
  }};

const drawn = timeline.drawn;
timeline.drawn = empty => { drawn(empty); drawCursor(); };
unpacked(data.values).then(values => timeline.setLanes([
  ...timeline.lanes, ...Object.entries(values).map(([name, changes]) => valueLane(name, changes, data.length))]));
byId("lanes").addEventListener("click", event => {
  const bar = event.target.closest(".bar");
  if (bar) travel((data.began + timeline.timeAt({clientX: bar.getBoundingClientRect().left})) / 1000 + 0.001);
});
byId("story").addEventListener("click", event => {
  const chosen = event.target.closest(".told time");
  if (chosen) travel(Number(chosen.parentElement.dataset.at) + 0.001);
});
[byId("scrub").min, byId("scrub").max] = [data.began / 1000, end];
listenToScrubber();
put(byId("live"), "End");
byId("then").hidden = false;
// a link to a visit shows how it ended
const [, linked] = /^#v(\d+)$/.exec(location.hash) || [], linkedVisit = data.visits.find(([number]) => String(number) === linked);
travel(linkedVisit ? (data.began + linkedVisit[3]) / 1000 : end);
