// The runs of this page.

const CLIPS = DATA.clips.map(clipOf);
