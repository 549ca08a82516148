// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Messages of the OpenIGTLink protocol (versions 1 to 3), by which trackers, scanners and 3D Slicer talk: IMAGE,
// TRANSFORM, STRING, NDARRAY and the TRACKEDFRAME of PlusServer. All comes from outside, so every number is checked before it
// is used. Numbers are big-endian.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace bigus
{

constexpr std::size_t kIgtHeaderBytes = 58;

/// What a message begins with.
struct IgtHeader
{
  int version = 1;
  std::string type, device;  ///< at most 12 and 20 characters
  double timestamp = 0;      ///< s; 0 where there is none
  std::uint64_t bodyBytes = 0;
  std::uint64_t checksum = 0;  ///< of the body
};

/// A picture of one slice of unsigned 8-bit pixels. Colours are read as grey, as in files.
struct IgtImage
{
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< [height][width]
  /// Pixel (i, j, 0, 1) to mm in RAS.
  Eigen::Matrix4d imageToWorld = Eigen::Matrix4d::Identity();
};

/// Reads kIgtHeaderBytes bytes. Throws Error for a version, a type or a size of body that cannot be: beyond
/// 2^26 bytes.
IgtHeader ParseIgtHeader(const std::uint8_t* bytes);

/// Throws Error when the body was damaged on its way, or is no whole message.
IgtImage ParseIgtImage(const IgtHeader& header, const std::vector<std::uint8_t>& body);

/// The matrix of a TRANSFORM. Throws Error as above.
Eigen::Matrix4d ParseIgtTransform(const IgtHeader& header, const std::vector<std::uint8_t>& body);

/// The text of a STRING. Throws Error as above.
std::string ParseIgtString(const IgtHeader& header, const std::vector<std::uint8_t>& body);

/// A picture, and what its sender knew at its time.
struct IgtTrackedFrame
{
  /// In marked-far order, as what the fields say refers to it. imageToWorld is what PlusServer calls embedded, where
  /// hasPose says so; else the identity.
  IgtImage image;
  bool hasPose = false;
  std::map<std::string, std::string> fields;  ///< such as ProbeToTrackerTransform and its status, as in a sequence
};

/// A TRACKEDFRAME of PlusServer, of all versions since 2.0. Throws Error as above.
IgtTrackedFrame ParseIgtTrackedFrame(const IgtHeader& header, const std::vector<std::uint8_t>& body);

/// Whole messages of version 1, with their header.
std::vector<std::uint8_t> PackIgtImage(const std::string& device, double timestamp, const IgtImage& image);
std::vector<std::uint8_t> PackIgtTransform(const std::string& device, double timestamp, const Eigen::Matrix4d& matrix);
/// Throws Error for a text of more than 65535 bytes.
std::vector<std::uint8_t> PackIgtString(const std::string& device, double timestamp, const std::string& text);
/// NDARRAY of 32-bit floats, the last side varying fastest. Throws Error where a side is beyond 65535 or there are other
/// than so many values.
std::vector<std::uint8_t> PackIgtArray(const std::string& device, double timestamp, const std::vector<int>& sides,
                                       const std::vector<float>& values);

}  // namespace bigus
