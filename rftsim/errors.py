"""What rftsim raises and warns with."""


class RftsimError(ValueError):
    """An input that cannot be: what was wrong, and what would have been right."""


class SandError(RftsimError):
    """Sand that cannot be."""


class SurfaceError(RftsimError):
    """A mesh that cannot bound a body: names the mesh and, where it can, the face."""


class SceneError(RftsimError):
    """A MuJoCo model that sand cannot be put under."""


class RftsimWarning(UserWarning):
    """Something that will be computed but is doubtful; with numbers."""
