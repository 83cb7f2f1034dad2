"""Stable-Baselines3's PPO learns to reach a goal among vessels that do not give way."""

import sys

import gymnasium
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy

import twinscrew.training.gym  # noqa: F401 - registers the environment

env = gymnasium.make("twinscrew/Vessel-v0", robots=3)
model = PPO(
    "MlpPolicy", env, n_steps=1024, batch_size=256, learning_rate=1e-3, seed=0, device="cpu"
)
before = evaluate_policy(model, env, n_eval_episodes=50, warn=False)[0]
model.learn(int(sys.argv[1]) if len(sys.argv) > 1 else 200_000)
after = evaluate_policy(model, env, n_eval_episodes=50, warn=False)[0]
print(f"mean return: {before:.1f} before, {after:.1f} after")
