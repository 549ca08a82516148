// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The sweeps that experiments are made on, from a few words of JSON; README.md of this folder lists them.
#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "Core/Model/Sweep.h"

/// Where files are: recorded data, and phantoms once made (empty: make them anew each time).
struct SceneFolders
{
  std::filesystem::path data, cache;
};

/// Throws bigus::Error naming the field or file at fault.
std::shared_ptr<const bigus::Sweep> MakeScene(const nlohmann::json& scene, const SceneFolders& folders);

/// The poses that the frames of a scene of phantoms were really taken at; empty for other scenes, and cropped ones.
std::vector<Eigen::Matrix4d> TruePoses(const nlohmann::json& scene);

/// What of a phantom's description its pixels follow from. The tracker moves no frame.
nlohmann::json WithoutTracker(nlohmann::json phantom);
