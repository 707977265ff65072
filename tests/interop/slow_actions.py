"""Slow twins of the authors' action networks: numbers in Python lists, in the axes of their world.

Written from what is known of their behaviour, with one loop for every sum, so that they share
neither layout nor folding nor axes with the code they are compared with.
"""

import math


def linear(own, name, inputs):
    weight, bias = own[f"{name}.weight"].tolist(), own[f"{name}.bias"].tolist()
    rows = zip(weight, bias, strict=True)
    return [b + sum(w * x for w, x in zip(row, inputs, strict=True)) for row, b in rows]


def angles_as_seen(angles):
    """(sin a, cos a, sin b, cos b, sin c, cos c)."""
    return [f(angle) for angle in angles for f in (math.sin, math.cos)]


def embedded(own, angles, place, box):
    """Mean and log-variance that A gives to one state."""
    values = angles_as_seen(angles) + [x / size for x, size in zip(place, box, strict=True)]
    for layer in (0, 3, 6):
        values = linear(own, f"action_network.mlp_backbone.{layer}", values)
        name = f"action_network.mlp_backbone.{layer + 1}"
        parts = ("gamma", "beta", "running_mean", "running_std")
        rows = zip(values, *(own[f"{name}.{part}"].tolist() for part in parts), strict=True)
        values = [max(0.0, (x - mean) / (std + 1e-5) * g + b) for x, g, b, mean, std in rows]
    heads = ("action_network.mean_fc", "action_network.log_variance_fc")
    return tuple(linear(own, head, values) for head in heads)


def direction(own, first, second, noise):
    """Direction between two embedded states and the logits it stands for."""
    drawn = []
    for m0, lv0, m1, lv1, n in zip(*first, *second, noise, strict=True):
        drawn.append(m1 - m0 + math.sqrt(math.exp(lv0) + math.exp(lv1)) * n)
    return drawn, linear(own, "action_network.final_fc", drawn)


def variability(own, action, drawn):
    """v of an action that may be a mixture."""
    centroids = own["centroid_estimator.estimated_centroids"].tolist()
    total = [0.0] * len(drawn)
    for share, centroid in zip(action, centroids, strict=True):
        total = [t + share * (d - c) for t, d, c in zip(total, drawn, centroid, strict=True)]
    return total


def sigmoid(x):
    return 1.0 / (1.0 + math.exp(-x))


def lstm_cell(own, name, inputs, hidden, cell):
    """One step of an LSTM cell; gates stand in the order input, forget, new, output."""
    width = len(hidden)
    rows = {part: own[f"{name}.{part}"].tolist() for part in ("weight_ih", "weight_hh")}
    bias = (own[f"{name}.bias_ih"] + own[f"{name}.bias_hh"]).tolist()
    gates = [
        bias[i]
        + sum(w * x for w, x in zip(rows["weight_ih"][i], inputs, strict=True))
        + sum(w * x for w, x in zip(rows["weight_hh"][i], hidden, strict=True))
        for i in range(4 * width)
    ]
    after, out = [], []
    for i in range(width):
        let_in, keep, new, let_out = (gates[i + part * width] for part in range(4))
        after.append(sigmoid(keep) * cell[i] + sigmoid(let_in) * math.tanh(new))
        out.append(sigmoid(let_out) * math.tanh(after[-1]))
    return out, after


def first_memory(own):
    """(hidden, cell) of both cells before the first step."""
    name = "dynamics_network.all_initial_hidden_{}states.{}"
    kinds = ("", "cell_")
    return [tuple(own[name.format(kind, layer)].tolist() for kind in kinds) for layer in range(2)]


def step(own, state, control, memory, world):
    """One step of R.

    `state` is (angles, place, style, pose), `control` (action, v), `world` the up axis, the box by
    which places are divided, and whether the angle about the up axis is predicted.
    """
    (angles, place, style, pose), (axis, box, turns) = state, world
    values = angles_as_seen(angles) + [x / size for x, size in zip(place, box, strict=True)]
    values += [*style, *pose, *control[0], *control[1]]
    memory = list(memory)
    for layer in range(2):
        name = f"dynamics_network.all_cells.{layer}"
        memory[layer] = lstm_cell(own, name, values, *memory[layer])
        values = memory[layer][0]
    values = [max(0.0, x) for x in linear(own, "dynamics_network.mlp_backbone.0", values)]
    heads = [linear(own, f"dynamics_network.mlp_heads.{head}", values) for head in range(4)]
    moved = [x + d for x, d in zip(place, turned(heads[1], axis, angles[axis]), strict=True)]
    moved[axis] = place[axis]
    after = list(angles)
    if turns:
        after[axis] += math.atan2(heads[0][2 * axis], heads[0][2 * axis + 1])
    return (after, moved, heads[2], heads[3]), memory


def turned(vector, axis, angle):
    """A vector after a right-handed turn about one axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    result = list(vector)
    result[i] = math.cos(angle) * vector[i] - math.sin(angle) * vector[j]
    result[j] = math.sin(angle) * vector[i] + math.cos(angle) * vector[j]
    return result


def judged(own, columns, valid):
    """D's logit of one sequence, given as rows of what it sees, one row a step."""
    for layer in (0, 2, 4):
        weight = normalised(own, f"model.{layer}").tolist()
        bias = own[f"model.{layer}.bias"].tolist()
        columns = [convolved(weight, bias, columns, t) for t in range(len(columns))]
    width, count = len(columns[0]), sum(valid) + 1
    kept = [row for row, counts in zip(columns, valid, strict=True) if counts]
    mean = [sum(row[i] for row in kept) / count for i in range(width)]
    row = normalised(own, "linear").tolist()[0]
    return own["linear.bias"].item() + sum(w * x for w, x in zip(row, mean, strict=True))


def convolved(weight, bias, columns, t):
    """Output of a convolution over five steps around t, after its ReLU."""
    result = []
    for kernel, shift in zip(weight, bias, strict=True):
        total = shift
        for k in range(5):
            if 0 <= t + k - 2 < len(columns):
                row = columns[t + k - 2]
                total += sum(kernel[c][k] * row[c] for c in range(len(row)))
        result.append(max(0.0, total))
    return result


def normalised(own, name):
    """A weight by its spectral norm, as its stored vectors measure it."""
    weight = own[f"{name}.weight_orig"]
    u, v, rows = own[f"{name}.weight_u"], own[f"{name}.weight_v"], weight.flatten(1)
    norm = sum(u[i] * rows[i, j] * v[j] for i in range(len(u)) for j in range(len(v)))
    return weight / norm
