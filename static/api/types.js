// @ts-check
/**
 * The JSON of the server, as types (docs/api.md). Nothing runs here.
 *
 * Pixels are pixels of the annotated size; points of the pitch are metres, z down.
 */

/**
 * @typedef {object} CameraJson
 * @property {number} pan_degrees
 * @property {number} tilt_degrees
 * @property {number} roll_degrees
 * @property {number} x_focal_length
 * @property {number} y_focal_length
 * @property {[number, number]} principal_point
 * @property {[number, number, number]} position_meters
 * @property {number} [skew]
 * @property {number[]} [radial_distortion]
 * @property {number[]} [tangential_distortion]
 * @property {number[]} [thin_prism_distortion]
 * @property {string} [lens] `brown_conrady`, `fisheye` or `arctan_polynomial`
 * @property {number[] | null} [lens_coefficients]
 * @property {number[][] | null} [covariance] position, angles, focal length, k1
 */

/** @typedef {{x: number, y: number}} PointJson */
/** @typedef {[number, number]} PairJson */
/** @typedef {[number, number, number, number]} BoxJson   x, y, width, height */
/** @typedef {{[marking: string]: PointJson[]}} LinesJson */

/**
 * @typedef {object} BallJson
 * @property {BoxJson | null} box
 * @property {PairJson | null} point
 * @property {boolean} occluded
 * @property {boolean} out_of_view
 * @property {'dataset' | 'person' | 'prediction'} [source] who says so
 * @property {boolean} [inferred] put where the 3D ball of the other views is seen; it confirms nothing
 * @property {string | null} [predicted_by] the set of predictions that a person accepted it from
 */

/**
 * @typedef {object} StationJson
 * @property {number} id
 * @property {string} key
 * @property {boolean} shared
 * @property {string} calibration
 * @property {boolean} has_given
 * @property {PictureJson | null} [picture]
 * @property {string} [etag]
 */

/** @typedef {{aspect: number, shift: number[], sigma: number[]}} PictureJson   what was done to it: shift and its sigma in half diagonals */
/** @typedef {{reason: string, note: string | null}} LeftOutJson */

/**
 * @typedef {object} ViewJson
 * @property {number} id
 * @property {string} key
 * @property {string} letter
 * @property {string} label
 * @property {number} width
 * @property {number} height
 * @property {boolean} included
 * @property {LeftOutJson | null} [left_out] why a person left it out
 * @property {StationJson} station
 * @property {LinesJson} lines
 * @property {string[]} [proposed] markings that a person accepted as they were proposed
 * @property {string[]} [not_visible] markings that a person says the picture does not show
 * @property {BallJson[]} balls
 * @property {string | null} image
 * @property {string | null} [neighbours] where the frames before and after are listed
 */

/**
 * @typedef {object} MarkingFitJson
 * @property {string} marking
 * @property {'tp' | 'fp' | 'fn'} outcome
 * @property {boolean} used
 * @property {number | null} largest_px
 * @property {number[]} distances_px
 * @property {PairJson[]} nearest
 * @property {PairJson[]} polyline
 */

/**
 * @typedef {object} CameraSigmaJson one standard deviation of each number
 * @property {number} pan_degrees
 * @property {number} tilt_degrees
 * @property {number} roll_degrees
 * @property {[number, number, number]} position_meters
 * @property {number} focal_px
 * @property {number} k1
 */

/**
 * @typedef {object} CalibrationJson
 * @property {string} source
 * @property {CameraJson | null} camera
 * @property {CameraSigmaJson | null} [sigma] how well the lines determine it
 * @property {string | null} reason
 * @property {{[gamma: string]: number} | null} jac
 * @property {number | null} error_px
 * @property {string[]} unobservable
 * @property {MarkingFitJson[]} markings
 * @property {PaintFitJson | null} [paint]
 */

/**
 * How a camera and the paint of its picture agree; `reason` says why the camera is that of the clicks.
 *
 * @typedef {object} PaintFitJson
 * @property {number | null} supported
 * @property {number | null} explained
 * @property {number | null} [agreement] supported times explained
 * @property {number} points
 * @property {number | null} error_px
 * @property {string | null} reason
 */

/**
 * @typedef {object} BallFitJson
 * @property {PairJson | null} reprojected
 * @property {number | null} error_px
 * @property {number | null} error_percent
 * @property {number | null} optimized_diameter_px
 * @property {BoxJson | null} optimized_box
 * @property {number | null} optimized_error_m
 * @property {BoxJson | null} exact_box
 * @property {number | null} size_ratio
 * @property {number | null} depth_m
 */

/**
 * @typedef {object} ViewSolutionJson
 * @property {string} view
 * @property {boolean} included
 * @property {string | null} failed
 * @property {CalibrationJson} calibration
 * @property {BallFitJson | null} ball
 * @property {{place: PairJson, covariance: (number | null)[], box: BoxJson | null} | null} [expected] where the 3D ball is to be seen
 */

/**
 * @typedef {object} PairSolutionJson
 * @property {string} a
 * @property {string} b
 * @property {[number, number, number]} point
 * @property {PairJson} errors_px
 * @property {number} baseline_m
 * @property {number} parallax_degrees
 * @property {boolean} valid
 * @property {string | null} failed
 */

/**
 * @typedef {object} GateJson
 * @property {string} name
 * @property {boolean} passed
 * @property {boolean} active
 * @property {number | null} value
 * @property {number | null} threshold
 * @property {number | null} margin
 * @property {string} sentence
 * @property {string | null} view
 */

/** @typedef {{gate: string, view: string | null, sentence: string}} FailingJson */

/**
 * @typedef {object} FixJson
 * @property {string} action
 * @property {string | null} view
 * @property {string | null} marking
 * @property {string | null} to
 * @property {number | null} index
 * @property {PairJson | null} [point] where a point would have to stand, image pixels
 */

/**
 * @typedef {{edit: 'set_lines', view: string, lines: {[marking: string]: PairJson[] | null}, source?: {[marking: string]: 'proposed' | 'not_visible'}}
 *   | {edit: 'set_balls', view: string, balls: BallJson[]}
 *   | {edit: 'set_picture', view: string, picture: PictureJson | null}
 *   | {edit: 'include_view', view: string, included: boolean}} EditJson   as the history writes edits
 */
/** @typedef {{label: string, edit: EditJson, caption: string}} OfferJson   label: of its button; caption: beside what it changes in the picture */
/**
 * @typedef {object} GuideJson where a person is led who has to look or draw
 * @property {string} label of its button
 * @property {string} caption words beside the place
 * @property {string | null} draws the marking to draw
 * @property {PairJson | null} looks where the ball would have to be, image pixels
 * @property {boolean} reads whether the pictures of the match are to be read again
 */

/**
 * @typedef {object} FindingJson
 * @property {string} kind
 * @property {string} sentence
 * @property {string | null} view
 * @property {string | null} marking
 * @property {string | null} suggested
 * @property {number | null} number
 * @property {number | null} threshold
 * @property {number | null} confidence
 * @property {FixJson | null} fix
 * @property {OfferJson[]} offers edits that correct it
 * @property {GuideJson | null} guide where no edit does
 * @property {boolean} unusable_ball whether nobody can use the ball: accepting needs a note
 * @property {{by: string, at: string, note: string | null} | null} [dismissed] who has checked it and found it fine
 */

/**
 * @typedef {object} Ball3DJson
 * @property {[number, number, number]} point
 * @property {number} height_m
 * @property {number | null} sigma_m null: not known, because lines leave a camera open
 * @property {(number | null)[]} covariance
 * @property {number} parallax_degrees
 * @property {string[]} views
 */

/**
 * @typedef {object} BestBallJson the most likely point over all views
 * @property {[number, number, number]} point
 * @property {number} height_m
 * @property {number | null} sigma_m null: not known, because lines leave a camera open
 * @property {(number | null)[]} covariance
 * @property {string[]} views
 * @property {string[]} [contradicting] views that speak against it
 */

/**
 * @typedef {object} SolutionJson
 * @property {boolean} passes
 * @property {FailingJson | null} first_failing
 * @property {GateJson[]} gates
 * @property {ViewSolutionJson[]} views
 * @property {PairSolutionJson[]} pairs
 * @property {Ball3DJson | null} ball
 * @property {BestBallJson | null} [best_ball]
 * @property {'mean' | 'best'} [point] which 3D ball is exported
 * @property {Ball3DJson | null} [mean_ball] where the most likely point is exported
 * @property {{value: number | null, p_value: number, views: string[]} | null} [chi_square]
 * @property {FindingJson[]} findings
 */

/**
 * @typedef {object} VerdictJson
 * @property {string} state
 * @property {string | null} reason
 * @property {string | null} note
 * @property {string | null} by
 * @property {string | null} at
 * @property {boolean} stale
 * @property {boolean} fixed
 */

/**
 * @typedef {object} PolicyJson
 * @property {string} name
 * @property {number} tau_percent
 * @property {number} min_jac
 * @property {number} jac_gamma_percent
 * @property {number} min_baseline_m
 * @property {number} ball_diameter_m
 * @property {'fixed' | 'estimated'} [noise] whose the sigmas of clicks are: the policy's, or the dataset's own
 * @property {{source?: string}} [calibration]
 */

/**
 * @typedef {object} GroupDocument
 * @property {number} id
 * @property {number} number
 * @property {{id: number, name: string}} dataset
 * @property {string} key
 * @property {string} label
 * @property {string} match
 * @property {{length: number, width: number}} pitch
 * @property {number} revision
 * @property {string} etag
 * @property {boolean} can_undo
 * @property {boolean} can_redo
 * @property {VerdictJson} verdict
 * @property {VerdictJson[]} verdicts the last one of every person
 * @property {PolicyJson} policy
 * @property {ViewJson[]} views
 * @property {SolutionJson | null} solution
 */

/**
 * @typedef {object} GroupRow
 * @property {number} id
 * @property {number} number
 * @property {string} key
 * @property {string} label
 * @property {string} status
 * @property {boolean} stale
 * @property {boolean | null} passes
 * @property {FailingJson | null} first_failing
 * @property {number | null} min_jac
 * @property {number | null} [agreement] the least of its views whose paint was read
 * @property {number | null} error_px
 * @property {number | null} sigma_m
 * @property {number | null} parallax_degrees
 * @property {number | null} size_ratio
 * @property {number | null} margin
 * @property {number} views
 * @property {number} pictures views that have one
 * @property {string} split
 * @property {string | null} reviewer
 * @property {string | null} reason why it was rejected
 * @property {string | null} override gate that failed when it was accepted all the same
 * @property {boolean} fixed
 * @property {number} comments threads that are open
 * @property {number | null} submissions how many people submitted an annotation of their own; null: for reviewers alone
 * @property {'agreed' | 'open' | 'decided' | null} annotations what these came to; open: somebody has to decide
 * @property {string[]} findings
 * @property {string | null} thumbnail
 */

/** @typedef {{items: GroupRow[], next: string | null, total: number}} GroupPage */
/** @typedef {{index: number | null, total: number, previous: number[], next: number[]}} Neighbours */

/**
 * @typedef {object} DatasetJson
 * @property {number} id
 * @property {string} name
 * @property {number} groups
 * @property {number} solved
 * @property {number} accepted
 * @property {number} rejected
 * @property {number} deferred
 * @property {number} unreviewed
 * @property {PolicyJson} policy
 * @property {string} created
 * @property {boolean} hides_groups whether groups are hidden from whoever asks, who annotates independently
 */

/** @typedef {{edges: number[], open_high: boolean, log: boolean, counts: number[], unknown: number}} Histogram */
/** @typedef {{[key: string]: number}} Counts */

/**
 * @typedef {object} ExportJson
 * @property {string | number} id
 * @property {string} status
 * @property {string | null} content
 * @property {Counts | null} counts
 * @property {string | null} [incomplete] what the files lack before they can be used
 * @property {string | null} [error]
 */

export {};
