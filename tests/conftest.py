"""Settings of the property tests; being here also puts this folder on the path, for `import oracle`."""

from hypothesis import settings

settings.register_profile("rftsim", deadline=None, max_examples=60, derandomize=True, database=None)
settings.load_profile("rftsim")
