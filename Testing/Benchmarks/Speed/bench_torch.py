# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The training pass of `bigus-bench` in PyTorch: the same Gaussians, planes, frames and batches, float32, on the CPU.

    python3 - WORKLOAD REPEATS THREADS < bench_torch.py

What one would write today with autograd and some care: Gaussians are culled per slice, footprints end where bigus ends
them, splats of like size are evaluated together on square patches that just hold them, the exponent is made of one row
and one column term a splat, and the graph is freed after every slice. Prints one JSON object.
"""
import json
import sys
import time

import numpy as np
import torch


def read(path):
    with open(path, "rb") as file:
        n, frames, width, height, batch = np.fromfile(file, np.int64, 5).tolist()
        gamma, elevation_sigma, bound, *rates = np.fromfile(file, np.float64, 7).tolist()

        def floats(*shape):
            return torch.from_numpy(np.fromfile(file, np.float32, int(np.prod(shape))).reshape(shape))

        field = [floats(n, 3), floats(n, 3), floats(n, 4), floats(n)]  # means, ln scales, quaternions, reflectivities
        planes = floats(frames, 3, 3)  # origin, column step, row step
        order = np.fromfile(file, np.int64, frames).reshape(-1, batch).tolist()
        pixels = np.fromfile(file, np.uint8, frames * height * width).reshape(frames, height, width)
        images = torch.from_numpy(pixels.astype(np.float32) / np.float32(255))
    return field, planes, order, images, gamma, elevation_sigma ** 2, bound, rates


def to_local(q, x):
    """[n, 3]: the world vector x (or vectors [n, 3]) in the axes of Gaussians turned by quaternions q."""
    w, u = q[:, :1], -q[:, 1:]
    x = x.expand(len(q), 3)
    t = 2 * torch.cross(u, x, dim=1)
    return x + w * t + torch.cross(u, t, dim=1)


def dot(a, b):
    return (a * b).sum(1)


def project(mean, log_scale, quaternion, plane, variance):
    """Upper triangular factor, centre and amplitude of each footprint, all [n]."""
    origin, a, b = plane
    area = torch.linalg.cross(a, b)
    n = area / area.norm()
    basis = torch.linalg.inv(torch.stack([a, b, n], 1))  # rows: world to (column, row, mm)
    q = quaternion / quaternion.norm(dim=1, keepdim=True)
    s = log_scale.exp()
    cu, cv, cz = (to_local(q, x) / s for x in (a, b, n))
    length = cz.norm(dim=1)
    e = cz / length[:, None]
    g = variance * length * length
    root = (1 + g).sqrt()
    kappa = (g / (1 + g + root))[:, None]
    du = cu - kappa * dot(e, cu)[:, None] * e
    dv = cv - kappa * dot(e, cv)[:, None] * e
    u11 = du.norm(dim=1)
    u12 = dot(du, dv) / u11
    sn = s * to_local(q, n)
    t = dot(sn, sn) + variance
    u22 = area.norm() / s.prod(1) * t.sqrt() / (root * u11)
    offset = mean - origin
    z = offset @ n
    ssn = s * sn
    mu = offset @ basis[0] - dot(to_local(q, basis[0]), ssn) * z / t
    mv = offset @ basis[1] - dot(to_local(q, basis[1]), ssn) * z / t
    return u11, u12, u22, mu, mv, (-0.5 * z * z / t).exp() / root


def visible(field, plane, variance, bound):
    """Gaussians near the plane."""
    mean, log_scale, _, reflectivity = field
    n = torch.linalg.cross(plane[1], plane[2])
    z = (mean - plane[0]) @ (n / n.norm())
    reach = 2 * (reflectivity.abs() / bound).log() * ((2 * log_scale.amax(1)).exp() + variance)
    return (z * z <= reach).nonzero()[:, 0]


def scattering(field, plane, variance, bound, height, width):
    with torch.no_grad():
        chosen = visible(field, plane, variance, bound)
    mean, log_scale, quaternion, reflectivity = (part[chosen] for part in field)
    u11, u12, u22, mu, mv, amplitude = project(mean, log_scale, quaternion, plane, variance)
    value = reflectivity * amplitude

    with torch.no_grad():
        k = (2 * (value.abs() / bound).log()).clamp(min=0).sqrt()
        half_v = k / u22
        half_u = k * (1 + (u12 / u22) ** 2).sqrt() / u11
        first_u, first_v = (mu - half_u).ceil(), (mv - half_v).ceil()
        last_u, last_v = (mu + half_u).floor(), (mv + half_v).floor()
        inside = (k > 0) & (last_u >= 0) & (last_v >= 0) & (first_u < width) & (first_v < height)
        inside &= (last_u >= first_u) & (last_v >= first_v)
        side = torch.maximum(last_u - first_u, last_v - first_v).long() + 1
        side = torch.where(inside, (side + 1) // 2 * 2, 0)  # even sides only: fewer groups
        margin = int(side.max()) if len(side) else 0
        stride = width + 2 * margin
        corner = (first_v.long() + margin) * stride + first_u.long() + margin
    # A margin around the image takes what patches draw beyond it.
    image = torch.zeros((height + 2 * margin) * stride)
    for size in side.unique().tolist():
        if size == 0:
            continue
        group = (side == size).nonzero()[:, 0]
        steps = torch.arange(size)
        du = first_u[group, None] + steps - mu[group, None]  # [n, size]
        dv = first_v[group, None] + steps - mv[group, None]
        eta1 = (u11[group, None] * du)[:, None, :] + (u12[group, None] * dv)[:, :, None]  # [n, rows, columns]
        eta2 = u22[group, None] * dv
        w = torch.exp(-0.5 * (eta1 * eta1 + (eta2 * eta2)[:, :, None]))
        index = corner[group, None, None] + steps[:, None] * stride + steps
        image = image.index_add(0, index.reshape(-1), (value[group, None, None] * w).reshape(-1))
    return image.view(height + 2 * margin, stride)[margin:margin + height, margin:margin + width]


def train(field, planes, order, images, gamma, variance, bound, rates):
    """Returns the loss of every step and the seconds of all."""
    field = [part.clone().requires_grad_() for part in field]
    optimizer = torch.optim.Adam([{"params": [part], "lr": rate} for part, rate in zip(field, rates)], eps=1e-18)
    height, width = images.shape[1:]
    losses = []
    start = time.perf_counter()
    for batch in order:
        optimizer.zero_grad()
        total = 0.0
        for frame in batch:
            s = scattering(field, planes[frame], variance, bound, height, width)
            intensity = 1 - torch.exp(-gamma * torch.relu(s))
            loss = (intensity - images[frame]).abs().sum() / (len(batch) * height * width)
            loss.backward()
            total += loss.item()
        optimizer.step()
        losses.append(total)
    return losses, time.perf_counter() - start


def main():
    path, repeats, threads = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    torch.set_num_threads(threads)
    workload = read(path)
    train(workload[0], workload[1], workload[2][:1], *workload[3:])  # warm
    seconds = []
    for _ in range(repeats):
        losses, time_taken = train(*workload)
        seconds.append(time_taken)
    print(json.dumps({"losses": losses, "seconds": seconds, "torch": torch.__version__}))


main()
