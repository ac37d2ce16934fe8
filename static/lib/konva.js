// @ts-check
/**
 * Konva as the one file that it also comes as: its modules would cost a first visit as many
 * requests as all of `state`. That file is a script of the older kind, which leaves a global.
 */

// @ts-expect-error It comes without types.
import 'konva/konva.min.js';

/** @type {typeof import('konva/lib/Core.js').default & Pick<typeof import('konva').default, 'Image'>} */
const Konva = /** @type {any} */ (globalThis).Konva;

// A layer is drawn when `ImageStage` says so, not once more for each value of it that is set.
Konva.autoDrawEnabled = false;

export default Konva;
