// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Formats numbers and times for display. Times are nanoseconds.

const UNITS = [['s', 1e9], ['ms', 1e6], ['\u00b5s', 1e3], ['ns', 1]];

/** "12.35 ms": four significant digits, whole nanoseconds and a suitable unit; a dash for a missing time. */
function formatTime(time) {
  if (time === null || time === undefined) return '\u2013';
  const ns = Math.round(time);
  if (ns === 0) return '0';
  const size = Math.abs(ns);
  const [unit, factor] = UNITS.find(([, f]) => size >= f) || UNITS[3];
  return `${Number((ns / factor).toPrecision(4))}\u00a0${unit}`;
}

/** Formats a time on an axis whose least distinguishable distance is `step`. */
function formatAxisTime(ns, step) {
  if (ns === 0) return '0';
  const [unit, factor] = UNITS.find(([, f]) => Math.abs(ns) >= f) || UNITS[3];
  const digits = Math.min(9, Math.max(0, Math.ceil(Math.log10(factor / Math.max(step, 1)))));
  return `${Number((ns / factor).toFixed(digits))} ${unit}`;
}

/** 1234567 -> "1 234 567". */
const formatCount = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, '\u202f');

/** "14.2 %". A ratio above 0 never reads as 0 %, and one below 1 never as 100 %. */
function formatPercent(ratio) {
  const percent = 100 * ratio;
  if (percent === 0) return '0\u00a0%';
  if (percent > 0 && percent < 0.05) return `${Number(percent.toPrecision(2))}\u00a0%`;
  if (percent < 100 && percent >= 99.95) return `${percent.toFixed(Math.min(12, Math.ceil(-Math.log10(100 - percent)) + 1))}\u00a0%`;
  return `${percent.toFixed(1)}\u00a0%`;
}

/** "0", "1 (0.0043 %)", for a column beside the total. */
function formatCountAndShare(part, whole) {
  if (whole === 0) return '\u2013';
  return part === 0 ? '0' : `${formatCount(part)} (${formatPercent(part / whole)})`;
}

// What the names and numbers of the document mean. The keys are those that the program writes, in the order of its
// enumerations; a test compares them (redag_lab/report/page_test.cpp).
const DRIVERS = {
  simulator: 'in virtual time',
  threads: 'on threads of this machine',
  ros: 'under ROS 2, as the executor saw it',
  ros_nodes: 'under ROS 2, as the nodes saw it',
  ros2: 'under ROS 2',  // of a plan; its runs are of the two before
};
const WORLDS = {
  simulator: 'virtual time',
  threads: 'threads',
  ros: 'ROS 2',
  ros_nodes: 'ROS 2',
  ros2: 'ROS 2',
};
const OUTCOMES = {
  in_flight: 'in progress',
  finished: 'finished',
  skipped: 'skipped',
  aborted: 'aborted',
};
const REASONS = {
  none: '',
  overrun: 'not started before the next release',
  precedence: 'not ready before the next release',
  queue_full: 'its queue was full',
  dag_full: 'its DAG was full',
  removed: 'its task was removed',
  exception: 'exception',
  budget: 'budget used up',
  no_data: 'no data',
  degraded: 'its DAG was degraded in HI mode',
};
const ENDS = {
  finished: 'finished here',
  aborted: 'aborted here',
  preempted: 'preempted here',
  open: 'continues',
  waits: 'waits from here',
  served: 'woken here',
};
const TONES = {
  good: '\u2713',
  bad: '\u2717',
  caution: '!',
  plain: '\u2022',
};
/** Returns the words for a value of an enumeration. */
const wordsAt = (words, value) => Object.values(words)[value];
/** Returns the value of an enumeration that has this name. */
const valueOf = (words, name) => Object.keys(words).indexOf(name);

// Cells of tables, with the number by which they are sorted.
const timeCell = (ns, rest = {}) => ({text: formatTime(ns), sort: ns ?? null, ...rest});
const countCell = (count, rest = {}) => ({text: formatCount(count), sort: count, ...rest});
const shareCell = (part, whole, rest = {}) => ({text: formatCountAndShare(part, whole), sort: whole === 0 ? null : part / whole, ...rest});
