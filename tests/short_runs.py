"""Trainings so short that a test can have one."""

from rftsim_envs import tasks

TASK = "FourFlapRunner"
SHORT = {"duration": 0.3}
STEPS = tasks.make(TASK, SHORT).config.steps
TINY = {"steps": 500, "n_envs": 4, "n_steps": 32, "batch_size": 32, "n_epochs": 2, "layers": (8,)}
