// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The projection and its adjoint are one piece of code for CPU and GPU: compiled for the device, they give
// what the host gives, up to rounding (contraction and exp differ).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "Core/Formula/Splat.h"
#include "Core/Numerics/Random.h"

namespace
{

struct Case
{
  bigus::Gaussian<double> gaussian;
  bigus::View<double> view;
  bigus::Moments<double> moments;
};

struct Result
{
  bigus::Splat<double> splat;
  bigus::GaussianGradient<double> gradient;
};

__host__ __device__ Result Evaluate(const Case& c)
{
  const auto projection = bigus::Project(c.gaussian, c.view);
  return {projection.splat, bigus::ProjectAdjoint(c.gaussian, projection, c.moments)};
}

__global__ void EvaluateAll(int n, const Case* __restrict__ cases, Result* __restrict__ results)
{
  const int i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= n)
  {
    return;
  }
  results[i] = Evaluate(cases[i]);
}

std::vector<Case> RandomCases(int n)
{
  bigus::RandomNumbers random(1);
  std::vector<Case> cases(n);
  for (Case& c : cases)
  {
    c.gaussian.mean = {random.Uniform(-5, 5), random.Uniform(-5, 5), random.Uniform(-1, 1)};
    c.gaussian.logScale = {random.Uniform(-3, 1), random.Uniform(-3, 1), random.Uniform(-3, 1)};
    double length = 0;
    for (double& q : c.gaussian.rotation)
    {
      q = random.Uniform(-1, 1);
      length += q * q;
    }
    for (double& q : c.gaussian.rotation)
    {
      q /= std::sqrt(length);
    }
    c.gaussian.reflectivity = random.Uniform(-2, 2);
    // A plane at z = 0 with pixels of a x b mm, so T's first rows are 1 / a and 1 / b.
    const double a = random.Uniform(0.05, 0.5), b = random.Uniform(0.05, 0.5), sigma = random.Uniform(0, 2);
    c.view = {{random.Uniform(-1, 1), random.Uniform(-1, 1), 0},
              {a, 0, 0},
              {0, b, 0},
              {0, 0, 1},
              {1 / a, 0, 0},
              {0, 1 / b, 0},
              a * b,
              sigma * sigma};
    const auto moment = [&random] { return random.Uniform(-1, 1); };
    c.moments = {moment(), moment(), moment(), moment(), moment(), moment(), 0};
  }
  return cases;
}

void ExpectNear(double device, double host, const char* what, int index)
{
  EXPECT_NEAR(device, host, 1e-9 * (1 + std::abs(host))) << what << " of case " << index;
}

TEST(SplatOnDevice, EqualsHost)
{
  int devices = 0;
  const cudaError_t status = cudaGetDeviceCount(&devices);
  if (status != cudaSuccess || devices == 0)
  {
    GTEST_SKIP() << "no CUDA device (" << cudaGetErrorString(status)
                 << "): the projection was compiled for one but not run";
  }
  const int n = 10000;
  const std::vector<Case> cases = RandomCases(n);
  std::vector<Result> results(n);
  Case* deviceCases = nullptr;
  Result* deviceResults = nullptr;
  ASSERT_EQ(cudaMalloc(&deviceCases, n * sizeof(Case)), cudaSuccess);
  ASSERT_EQ(cudaMalloc(&deviceResults, n * sizeof(Result)), cudaSuccess);
  ASSERT_EQ(cudaMemcpy(deviceCases, cases.data(), n * sizeof(Case), cudaMemcpyHostToDevice), cudaSuccess);
  EvaluateAll<<<(n + 127) / 128, 128>>>(n, deviceCases, deviceResults);
  ASSERT_EQ(cudaGetLastError(), cudaSuccess);
  ASSERT_EQ(cudaMemcpy(results.data(), deviceResults, n * sizeof(Result), cudaMemcpyDeviceToHost), cudaSuccess);
  cudaFree(deviceCases);
  cudaFree(deviceResults);

  for (int i = 0; i < n; ++i)
  {
    const Result host = Evaluate(cases[i]);
    const Result& device = results[i];
    ExpectNear(device.splat.u11, host.splat.u11, "u11", i);
    ExpectNear(device.splat.u12, host.splat.u12, "u12", i);
    ExpectNear(device.splat.u22, host.splat.u22, "u22", i);
    ExpectNear(device.splat.mu, host.splat.mu, "mu", i);
    ExpectNear(device.splat.mv, host.splat.mv, "mv", i);
    ExpectNear(device.splat.amplitude, host.splat.amplitude, "amplitude", i);
    ExpectNear(device.gradient.mean.x, host.gradient.mean.x, "mean gradient x", i);
    ExpectNear(device.gradient.mean.y, host.gradient.mean.y, "mean gradient y", i);
    ExpectNear(device.gradient.mean.z, host.gradient.mean.z, "mean gradient z", i);
    ExpectNear(device.gradient.logScale.x, host.gradient.logScale.x, "scale gradient x", i);
    ExpectNear(device.gradient.logScale.y, host.gradient.logScale.y, "scale gradient y", i);
    ExpectNear(device.gradient.logScale.z, host.gradient.logScale.z, "scale gradient z", i);
    ExpectNear(device.gradient.rotation.x, host.gradient.rotation.x, "rotation gradient x", i);
    ExpectNear(device.gradient.rotation.y, host.gradient.rotation.y, "rotation gradient y", i);
    ExpectNear(device.gradient.rotation.z, host.gradient.rotation.z, "rotation gradient z", i);
  }
}

}  // namespace
