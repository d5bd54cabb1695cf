// Search of the manual. PAGES, written in front of this by tools/manual_search.py, holds
// [name, title, [[anchor, heading, text], ...]] of each page; a page opened with ?q=words shows what is found.
const box = document.getElementById("search");
const found = document.getElementById("found");
const page = document.querySelector("main");
const LIMIT = 40, AROUND = 90;

const escaped = (text) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

function marked(text, words) {
  const pattern = words.map((w) => w.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join("|");
  return text.split(new RegExp(`(${pattern})`, "gi"))
    .map((part, k) => (k % 2 ? `<mark>${escaped(part)}</mark>` : escaped(part))).join("");
}

// all words must be there; a heading counts more than the text, a whole word more than a part
function score(heading, text, words) {
  let sum = 0;
  for (const word of words) {
    const inHeading = heading.indexOf(word), inText = text.indexOf(word);
    if (inHeading < 0 && inText < 0) return 0;
    const names = heading.split(/[^\p{L}\p{N}_]+/u);
    sum += names.includes(word) ? 20 : inHeading >= 0 ? 8 : 0;
    sum += inText >= 0 ? Math.min(text.split(word).length - 1, 5) : 0;
  }
  return sum;
}

function search(query) {
  const words = query.toLowerCase().split(/\s+/).filter(Boolean);
  const hits = [];
  if (words.length) {
    for (const [name, title, sections] of PAGES) {
      for (const [anchor, heading, text] of sections) {
        const worth = score(`${title} ${heading}`.toLowerCase(), text.toLowerCase(), words);
        if (worth > 0) hits.push({ worth, name, title, anchor, heading, text });
      }
    }
  }
  hits.sort((a, b) => b.worth - a.worth);
  return { words, hits };
}

function show(query) {
  const { words, hits } = search(query);
  found.hidden = !words.length;
  page.hidden = !found.hidden;
  if (found.hidden) return;
  const rows = hits.slice(0, LIMIT).map((hit) => {
    const at = Math.max(0, ...words.map((w) => hit.text.toLowerCase().indexOf(w)));
    const start = Math.max(0, at - AROUND);
    const piece = (start ? "… " : "") + hit.text.slice(start, at + 2 * AROUND);
    const where = hit.heading === hit.title ? "" : ` <small>${escaped(hit.title)}</small>`;
    return `<a href="${hit.name}.html#${hit.anchor}">${marked(hit.heading, words)}</a>${where}` +
      `<p>${marked(piece, words)}</p>`;
  });
  const more = hits.length > LIMIT ? `, the best ${LIMIT} of them` : "";
  found.innerHTML = `<h1>${escaped(query)}</h1><p>${hits.length} found${more}</p>${rows.join("")}`;
}

box.addEventListener("input", () => show(box.value));
// a link to a place of this very page closes the list
found.addEventListener("click", (event) => {
  if (event.target.closest("a")) { box.value = ""; show(""); }
});
document.addEventListener("keydown", (event) => {
  if (event.key === "/" && document.activeElement !== box) { event.preventDefault(); box.focus(); }
  if (event.key === "Escape") { box.value = ""; show(""); }
});
const asked = new URLSearchParams(location.search).get("q");
if (asked) { box.value = asked; show(asked); }
const here = document.querySelector("nav a.here");
if (here) here.scrollIntoView({ block: "nearest" });
