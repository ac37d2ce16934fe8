// @ts-check
/** Keys of the page of a link: they move the side that has the focus. */

/** @import {Binding} from '../../lib/keys.js' */
/** @import {Player} from '../../state/playback.js' */

/** @typedef {{player: Player, focus: (side: 'live' | 'replay') => void, linkHere: () => void, playTogether: () => void, showBeside: (way: 1 | -1) => void, undo: () => void, second: number}} Doing */

/** @param {{current: Doing}} doing @returns {Binding[]} */
export function keysOfLink(doing) {
	const [look, edit] = ['Live and replay', 'Link'];
	const player = () => doing.current.player;
	return [
		{ keys: ['1'], label: 'Keys move the live shot', group: look, run: () => doing.current.focus('live') },
		{ keys: ['2'], label: 'Keys move the replay', group: look, run: () => doing.current.focus('replay') },
		{ keys: [' '], label: 'Play or stop', group: look, shown: 'Space', run: () => player().toggleRunning() },
		{ keys: ['l'], label: 'Play forwards; press again to double the speed', group: look, run: () => player().run(1) },
		{ keys: ['k'], label: 'Stop', group: look, run: () => player().stand() },
		{ keys: ['j'], label: 'Play backwards; press again to double the speed', group: look, run: () => player().run(-1) },
		{ keys: ['ArrowRight'], label: 'Next frame', group: look, repeats: true, run: () => { player().stepBy(1); } },
		{ keys: ['ArrowLeft'], label: 'Previous frame', group: look, repeats: true, run: () => { player().stepBy(-1); } },
		{ keys: ['Shift+ArrowRight'], label: 'One second forward', group: look, repeats: true, run: () => { player().stepBy(doing.current.second); } },
		{ keys: ['Shift+ArrowLeft'], label: 'One second back', group: look, repeats: true, run: () => { player().stepBy(-doing.current.second); } },
		{ keys: ['ArrowDown'], label: 'Next linked instant, in both shots', group: look, repeats: true, run: () => doing.current.showBeside(1) },
		{ keys: ['ArrowUp'], label: 'Previous linked instant, in both shots', group: look, repeats: true, run: () => doing.current.showBeside(-1) },
		{ keys: ['p'], label: 'Play together: the replay follows the live shot', group: look, run: () => doing.current.playTogether() },
		{ keys: ['i'], label: 'Link the two frames: both show the same instant', group: edit, needs: 'annotate', run: () => doing.current.linkHere() },
		{ keys: ['Ctrl+z'], label: 'Undo the last change of the link', group: edit, needs: 'annotate', run: () => doing.current.undo() },
	];
}
