"""The errors that rftsim raises, the warning that it warns with, and the note by which it tells its choices."""


class RftsimError(ValueError):
    """Error of an input that cannot be: says what was wrong, and what would have been right."""


class SandError(RftsimError):
    """Error of a sand that cannot be, by its parameters or its name."""


class SurfaceError(RftsimError):
    """Error of a mesh that cannot bound a body: names the mesh and, where it can, the face."""


class SceneError(RftsimError):
    """Error of a MuJoCo model that sand cannot be put under."""


class RftsimWarning(UserWarning):
    """Warning of something that will be computed but is doubtful, with numbers."""


class RftsimNote(UserWarning):
    """Note of a choice that was made at load, as whose place the sand takes: nothing is wrong, but one should know."""
