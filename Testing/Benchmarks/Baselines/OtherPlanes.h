// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Planes that are no frames of a scene, but whose picture is known; README.md of this folder says which.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "Core/Model/Sweep.h"
#include "KnownPlanes.h"
#include "Scene.h"

/// The number behind a prefix: degrees of "turned_30"; nothing for another name.
std::optional<double> NumberAfter(const std::string& name, const std::string& prefix);

/// Frames of the world of a phantom's scene, swept in a direction turned by so many degrees, at their true poses. Throws
/// bigus::Error for a scene of anything else.
std::shared_ptr<const bigus::Sweep> MakeTurnedScene(double degrees, nlohmann::json scene, const SceneFolders& folders);

/// Whether a set of this name is one of those below; frames of the sweep have other names.
bool IsSetOfOtherPlanes(const std::string& name);

/// The planes of set `name`: planes_x, planes_y, or planes_D and turned_D with D in degrees. `sweep` is what MakeScene
/// made of `scene`, with the mask of what its training frames light. Scored is what the training frames enclose (see
/// FindEnclosed). At most `count` planes, 0: 40. Throws bigus::Error when the scene has no such planes.
std::vector<bigus::KnownPlane> MakeOtherPlanes(const std::string& name, const nlohmann::json& scene,
                                               const SceneFolders& folders, const bigus::Sweep& sweep,
                                               const std::vector<int>& training, int count);
