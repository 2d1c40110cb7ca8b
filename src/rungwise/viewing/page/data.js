// The runs of this page.

const DATA = JSON.parse($("data").textContent);
const CLIPS = DATA.clips.map(clipOf);
const END = Math.max(...CLIPS.map(c => c.time[c.time.length - 1]));
const shown = () => CLIPS.filter(c => c.visible);
