// @ts-check
/** Files that the browser makes itself. */

/** Let the person save bytes as a file. @param {string} name @param {Blob} blob */
function saveBlob(name, blob) {
	const url = URL.createObjectURL(blob);
	const link = document.createElement('a');
	link.href = url;
	link.download = name;
	document.body.append(link);
	link.click();
	link.remove();
	setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** @param {string} name @param {string} text */
export function saveText(name, text) {
	saveBlob(name, new Blob([text], { type: 'text/plain' }));
}
