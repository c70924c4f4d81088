"""Half-inverse training of the oscillator chains, as one writes it in JAX.

The problems are those of problems/oscillator_chain.h: the same data, networks,
batch sizes and truncations. Seconds are those of the processor, without
compilation and evaluation, so run it on one core:

  XLA_FLAGS=--xla_cpu_multi_thread_eigen=false taskset -c 0 \
      python3 docs/results/half_inverse_jax.py linear gram --seconds=10

Needs: pip install jax. With a GPU, JAX takes it, and --wall counts its time.
"""
import argparse
import time

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

jax.config.update("jax_enable_x64", True)

CHAINS = {  # steps, dt, linear, cubic, control, batch, truncation, activation
    "linear": (24, 0.5, 0.2, 0.0, 1.0, 32, 1e-10, jnp.tanh),
    "cubic": (96, 0.125, 0.0, 1.0, 3.0, 128, 1e-6, jax.nn.relu),
}
parser = argparse.ArgumentParser()
parser.add_argument("chain", choices=CHAINS)
parser.add_argument("method", choices=["svd", "gram", "adam"])
parser.add_argument("--seconds", type=float, default=10.0)
parser.add_argument("--step_size", type=float, default=1.0)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--wall", action="store_true")
args = parser.parse_args()
(num_steps, dt, linear, cubic, control, batch_size, truncation,
 activation) = CHAINS[args.chain]
clock = time.perf_counter if args.wall else time.process_time


def derivative(state, force):
    q, v = state[:2], state[2:]
    gap = q[1] - q[0]
    coupling = linear * gap + cubic * gap**3
    return jnp.array([v[0], v[1], coupling - q[0],
                      control * force - coupling - q[1]])


def simulate(start, forces):
    def runge_kutta(state, force):
        k1 = derivative(state, force)
        k2 = derivative(state + 0.5 * dt * k1, force)
        k3 = derivative(state + 0.5 * dt * k2, force)
        k4 = derivative(state + dt * k3, force)
        return state + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), None
    return jax.lax.scan(runge_kutta, start, forces)[0]


def initial_layers(rng, sizes):
    for rows, cols in zip(sizes[:-1], sizes[1:]):
        limit = np.sqrt(6.0 / (rows + cols))  # Glorot
        yield jnp.asarray(rng.uniform(-limit, limit, (rows, cols))), jnp.zeros(cols)


rng = np.random.RandomState(args.seed)
weights, unravel = ravel_pytree(
    list(initial_layers(rng, [4, 20, 20, 20, num_steps])))


def residuals(w, start):  # of one sample
    *hidden, last = unravel(w)
    a = start
    for W, b in hidden:
        a = activation(a @ W + b)
    return simulate(start, a @ last[0] + last[1]) - start


def loss(w, starts):
    r = jax.vmap(residuals, (None, 0))(w, starts)
    return jnp.sum(r**2) / starts.shape[0]


def half_inverse_step(state, starts):
    w = state
    J = jax.vmap(jax.jacrev(residuals), (None, 0))(w, starts).reshape(-1, w.size)
    r = jax.vmap(residuals, (None, 0))(w, starts)
    g = 2.0 / starts.shape[0] * r.reshape(-1)
    if args.method == "svd":
        U, s, Vt = jnp.linalg.svd(J, full_matrices=False)
        keep = s > truncation * s[0]
        direction = Vt.T @ (jnp.where(keep, s, jnp.inf)**-0.5 * (U.T @ g))
    else:  # J = U S V^T, J J^T = U S^2 U^T
        square, U = jnp.linalg.eigh(J @ J.T)
        least = max(truncation**2, square.size * jnp.finfo(w.dtype).eps)
        keep = square > least * square[-1]
        direction = J.T @ (U @ (jnp.where(keep, square, jnp.inf)**-0.75 * (U.T @ g)))
    return w - args.step_size * direction, None


def adam_step(state, starts):  # with the cosine schedule by `progress`
    w, m, v, t, progress = state
    g = jax.grad(loss)(w, starts)
    m, v, t = 0.9 * m + 0.1 * g, 0.999 * v + 0.001 * g**2, t + 1.0
    size = args.step_size * 0.5 * (1.0 + jnp.cos(jnp.pi * progress))
    step = m / (1.0 - 0.9**t) / (jnp.sqrt(v / (1.0 - 0.999**t)) + 1e-7)
    return (w - size * step, m, v, t, progress), None


is_adam = args.method == "adam"
step = adam_step if is_adam else half_inverse_step
epoch = jax.jit(lambda state, batches: jax.lax.scan(step, state, batches)[0])
test_loss = jax.jit(loss)
np.random.seed(0)
data = np.random.rand(8192, 4)
train, test = data[:4096], jnp.asarray(data[4096:])


def shuffled_batches():
    return jnp.asarray(rng.permutation(train).reshape(-1, batch_size, 4))


zeros = jnp.zeros_like(weights)
state = (weights, zeros, zeros, 0.0, 0.0) if is_adam else weights
jax.block_until_ready(epoch(state, shuffled_batches()))  # compiles
seconds, num_batches = 0.0, 0
while seconds < args.seconds:
    batches = shuffled_batches()
    if is_adam:
        state = (*state[:4], seconds / args.seconds)
    begin = clock()
    state = jax.block_until_ready(epoch(state, batches))
    seconds += clock() - begin
    num_batches += batches.shape[0]
w = state[0] if is_adam else state
print(f"{args.chain} {args.method} on {jax.devices()[0].platform}: "
      f"{1e3 * seconds / num_batches:.3f} ms a step, {num_batches} steps, "
      f"test loss {test_loss(w, test):.3g}")
