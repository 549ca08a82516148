// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The anatomy: which tissue lies where, and how it echoes.
#pragma once

#include <Eigen/Dense>

namespace bigus
{

enum class Tissue
{
  Parenchyma,
  Vessel,    ///< blood: weak scatterers
  Cyst,      ///< fluid: no scatterers, no attenuation
  Boundary,  ///< the bright surface of the bone
  Bone,      ///< attenuates strongly: its shadow
  Tumour
};

struct TissueProperties
{
  double density;      ///< scatterers, relative to parenchyma, at most 1
  double amplitude;    ///< of a scatterer, relative to parenchyma
  double attenuation;  ///< relative to parenchyma
};

const TissueProperties& PropertiesOf(Tissue tissue);

/// The tissue of the organ scene at a point, mm.
Tissue OrganAt(const Eigen::Vector3d& p);

/// Amplitude of parenchyma at a point of the organ scene: its echoes rise and fall by at most 2 dB over centimetres.
double ParenchymaTexture(const Eigen::Vector3d& p);

}  // namespace bigus
