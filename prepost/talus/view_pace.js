"use strict";
// How much is drawn while something moves, so that the page keeps its pictures a second: pure
// functions of the times measured, without a clock or a screen of their own.

const TARGET = 1000 / 30; // milliseconds a picture
const LEVELS = [ // share of the resolution of the screen each way, share of the grains
  [1, 1], [1, 1], [0.85, 1], [0.7, 1], [0.6, 1], [0.5, 1], [0.4, 1], [0.4, 0.7], [0.35, 0.5],
  [0.3, 0.35], [0.3, 0.2],
].map(([resolution, share], k) => ({ resolution, share, exact: k === 0 }));
const SAMPLE = 8; // pictures measured before a decision
const SLOW = 1.15, FAST = 0.75; // of the target: nothing changes between them
const REST = 200; // milliseconds after the last movement until the full picture is begun, at least
const LONGEST = 1000; // a longer wait was no picture: the page was out of sight
const PATIENCE = [12, 192]; // least and most pictures before a better level is tried again

function startPace(level = 0) {
  return { level, times: [], held: 0, patience: PATIENCE[0], climbed: false };
}

// the level for a machine that needs so many milliseconds for the full picture, which has some 16
// times as much to do as that of level 0
function firstLevel(ms) {
  const slower = ms / 16 / TARGET;
  return slower <= 1 ? 0 : Math.min(LEVELS.length - 1, Math.ceil(2 * Math.log2(slower)));
}

// The pace after one more picture that took `ms`. Slow pictures lower the level, by more the slower
// they are; fast ones raise it by one. A raise that proves too slow is tried again ever later.
function nextPace(pace, ms) {
  if (!(ms > 0) || ms > LONGEST) return pace;
  const times = [...pace.times, ms], held = pace.held + 1;
  if (times.length < SAMPLE) return { ...pace, times, held };
  const ratio = mean(times) / TARGET, last = LEVELS.length - 1;
  if (ratio > SLOW && pace.level < last) {
    const down = ratio > 2.5 ? 3 : ratio > 1.6 ? 2 : 1;
    const patience = pace.climbed ? Math.min(2 * pace.patience, PATIENCE[1]) : pace.patience;
    return { ...startPace(Math.min(last, pace.level + down)), patience };
  }
  if (ratio < FAST && pace.level > 0 && held >= pace.patience)
    return { ...startPace(pace.level - 1), patience: pace.patience, climbed: true };
  const climbed = pace.climbed && held < PATIENCE[0];
  return { ...pace, times: times.slice(1), held, climbed };
}

function mean(times) { return times.reduce((sum, ms) => sum + ms, 0) / (times.length || 1); }

// Milliseconds without movement until the full picture is begun: of a machine so slow that its
// pictures are as far apart, the hand is not taken to rest between two of them.
function restAfter(times) { return Math.min(LONGEST, Math.max(REST, 3 * mean(times.slice(-5)))); }

function atFloor(pace) { return pace.level === LEVELS.length - 1; }

// Whether a grain belongs to the share that is drawn: multiples of the golden section spread
// evenly, each share contains the smaller ones, and a grain stays where the share stays.
function isDrawn(grain, share) { return rankOf(grain) < share * 4294967296; }
function rankOf(grain) { return Math.imul(grain, 2654435769) >>> 0; }

// every how many contacts are drawn for a share of the grains
function linkStep(share) { return Math.min(10, Math.max(1, Math.round(1 / share))); }

function paceText(pace, ms) {
  const { resolution, share } = LEVELS[pace.level], per = (part) => `${Math.round(100 * part)} %`;
  const grains = share < 1 ? `${per(share)} of the grains` : "all grains";
  return `${Math.round(1000 / ms)} frames/s, ${per(resolution)} of the resolution, ${grains}`;
}
