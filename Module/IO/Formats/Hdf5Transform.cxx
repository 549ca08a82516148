// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// https://docs.hdfgroup.org/hdf5/develop/_f_m_t3.html: section numbers below are those of this page.
#include "IO/Formats/Hdf5Transform.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>

#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t largestHdf5Transform = 1u << 20;
constexpr std::size_t mostBlocks = 64;      // continuations of one object's header
constexpr std::size_t mostTransforms = 16;  // of a composite
constexpr std::size_t mostNumbers = 64;     // of one transform; an affine one has 12
const std::string kMagic("\x89HDF\r\n\x1a\n", 8);
constexpr std::uint64_t kUndefined = ~std::uint64_t(0);  // an address that leads nowhere

/// One message of an object's header: its type, and where its data are in the file.
struct Message
{
  int type;
  std::uint64_t at, size;
};

enum MessageType
{
  Dataspace = 0x01,
  LinkInfo = 0x02,
  Datatype = 0x03,
  Link = 0x06,
  Layout = 0x08,
  Filters = 0x0B,
  Continuation = 0x10
};

class File
{
public:
  explicit File(const std::string& fileName) : name_(fileName), bytes_(ReadTextFile(fileName, largestHdf5Transform))
  {
    const std::uint64_t version = Number(8, 1);  // II.B
    RequireKind(version == 2 || version == 3, "its superblock has version ", version);
    RequireKind(Number(9, 1) == 8 && Number(10, 1) == 8, "its addresses have not 8 bytes");
    if (Number(12, 8) != 0)  // the base address
    {
      Refuse("it does not begin at its first byte");
    }
    root_ = Number(36, 8);
  }

  std::uint64_t Root() const { return root_; }

  [[noreturn]] void Refuse(const std::string& what) const
  {
    throw FormatError(name_ + ": an HDF5 file that is not read: " + what + "; save the transform as .tfm");
  }

  template <class... Parts>
  void RequireKind(bool holds, const Parts&... what) const
  {
    if (!holds)
    {
      Refuse(MessageText(what...));
    }
  }

  /// A little-endian number of `size` bytes.
  std::uint64_t Number(std::uint64_t at, std::uint64_t size) const
  {
    Require(at, size);
    std::uint64_t number = 0;
    for (std::uint64_t k = size; k-- > 0;)
    {
      number = number << 8 | static_cast<unsigned char>(bytes_[at + k]);
    }
    return number;
  }

  std::string Text(std::uint64_t at, std::uint64_t size) const
  {
    Require(at, size);
    return bytes_.substr(at, size);
  }

  /// The messages of the object whose header is at `address` (IV.A.1.b).
  std::vector<Message> Messages(std::uint64_t address) const
  {
    RequireKind(Text(address, 4) == "OHDR" && Number(address + 4, 1) == 2, "an object's header is of an older kind");
    const std::uint64_t flags = Number(address + 5, 1);
    std::uint64_t at = address + 6 + (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0);
    const std::uint64_t sizeBytes = std::uint64_t(1) << (flags & 3);
    const std::uint64_t size = Number(at, sizeBytes);
    at += sizeBytes;
    Require(at, size);
    std::vector<std::pair<std::uint64_t, std::uint64_t>> blocks = {{at, at + size}};
    std::vector<Message> messages;
    const std::uint64_t head = flags & 0x04 ? 6 : 4;  // with the order of creation
    for (std::size_t block = 0; block < blocks.size(); ++block)
    {
      auto [from, to] = blocks[block];
      while (from + head <= to)
      {
        const Message message{static_cast<int>(Number(from, 1)), from + head, Number(from + 1, 2)};
        Require(message.at, message.size);
        from = message.at + message.size;
        if (message.type != Continuation)
        {
          messages.push_back(message);
          continue;
        }
        const std::uint64_t start = Number(message.at, 8), length = Number(message.at + 8, 8);
        Require(start, length);
        RequireKind(length >= 8 && Text(start, 4) == "OCHK" && blocks.size() < mostBlocks,
                    "an object's header goes on at a place that is none");
        blocks.emplace_back(start + 4, start + length - 4);  // without its name and its checksum
      }
    }
    return messages;
  }

  /// Where the object `name` of the group at `group` is; kUndefined where there is none.
  std::uint64_t Find(std::uint64_t group, const std::string& name) const
  {
    bool isDense = false;
    for (const Message& message : Messages(group))
    {
      if (message.type == LinkInfo)  // IV.A.2.c
      {
        const std::uint64_t heap = message.at + (Number(message.at + 1, 1) & 1 ? 10 : 2);
        isDense = Number(heap, 8) != kUndefined;
      }
      if (message.type != Link)
      {
        continue;
      }
      const std::uint64_t flags = Number(message.at + 1, 1);  // IV.A.2.g
      std::uint64_t at = message.at + 2;
      const std::uint64_t type = flags & 0x08 ? Number(at++, 1) : 0;
      at += (flags & 0x04 ? 8 : 0) + (flags & 0x10 ? 1 : 0);
      const std::uint64_t lengthBytes = std::uint64_t(1) << (flags & 3);
      const std::uint64_t length = Number(at, lengthBytes);
      at += lengthBytes;
      if (length != name.size() || Text(at, length) != name)
      {
        continue;
      }
      RequireKind(type == 0, "'", name, "' is a link to elsewhere");
      return Number(at + length, 8);
    }
    RequireKind(!isDense, "a group has more links than its header holds");
    return kUndefined;
  }

  struct Data
  {
    std::uint64_t count = 1;  ///< elements
    std::uint64_t type = 0;   ///< class of the datatype: 1 floating point, 3 text, 9 variable length
    std::uint64_t bits = 0;   ///< its class bits
    std::uint64_t elementSize = 0;
    std::uint64_t at = kUndefined, size = 0;
  };

  Data ReadData(std::uint64_t object) const
  {
    Data data;
    for (const Message& message : Messages(object))
    {
      const std::uint64_t at = message.at;
      if (message.type == Dataspace)  // IV.A.2.b
      {
        const std::uint64_t version = Number(at, 1), rank = Number(at + 1, 1);
        if (rank > 1 || (version != 1 && version != 2))
        {
          Refuse("its arrays have more than one axis");
        }
        data.count = rank == 1 ? Number(at + (version == 1 ? 8 : 4), 8) : 1;
      }
      else if (message.type == Datatype)  // IV.A.2.d
      {
        data.type = Number(at, 1) & 0x0F;
        data.bits = Number(at + 1, 3);
        data.elementSize = Number(at + 4, 4);
      }
      else if (message.type == Layout)  // IV.A.2.i
      {
        const std::uint64_t version = Number(at, 1), kind = Number(at + 1, 1);
        if ((version != 3 && version != 4) || kind > 1)
        {
          Refuse("its arrays lie in pieces, as they do when compressed");
        }
        data.at = kind == 1 ? Number(at + 2, 8) : at + 4;
        data.size = kind == 1 ? Number(at + 10, 8) : Number(at + 2, 2);
      }
      else if (message.type == Filters)
      {
        Refuse("its arrays are compressed");
      }
    }
    RequireKind(data.count <= mostNumbers && data.elementSize <= largestHdf5Transform &&
                    data.size >= data.count * data.elementSize,
                "an array has a size that is none");
    return data;
  }

  std::vector<double> Numbers(std::uint64_t object) const
  {
    const Data data = ReadData(object);
    const bool isBigEndian = (data.bits & 0x41) != 0;
    if (data.type != 1 || isBigEndian || (data.elementSize != 8 && data.elementSize != 4))
    {
      Refuse("its numbers are not of double or single precision");
    }
    std::vector<double> numbers;
    for (std::uint64_t k = 0; k < data.count; ++k)
    {
      const std::uint64_t raw = Number(data.at + k * data.elementSize, data.elementSize);
      double number = 0;
      if (data.elementSize == 8)
      {
        std::memcpy(&number, &raw, 8);
      }
      else
      {
        const auto low = static_cast<std::uint32_t>(raw);
        float single = 0;
        std::memcpy(&single, &low, 4);
        number = single;
      }
      numbers.push_back(number);
    }
    return numbers;
  }

  /// The one text of an array: of a fixed length, or in a global heap (III.E).
  std::string Word(std::uint64_t object) const
  {
    const Data data = ReadData(object);
    if (data.count != 1 || (data.type != 3 && data.type != 9))
    {
      Refuse("the type of a transform is no text");
    }
    if (data.type == 3)
    {
      const std::string text = Text(data.at, data.elementSize);
      return text.substr(0, text.find('\0'));
    }
    const std::uint64_t length = Number(data.at, 4), heap = Number(data.at + 4, 8), wanted = Number(data.at + 12, 4);
    RequireKind(Text(heap, 4) == "GCOL", "a text is not where it should be");
    const std::uint64_t heapSize = Number(heap + 8, 8);
    Require(heap, heapSize);
    for (std::uint64_t at = heap + 16; at + 16 <= heap + heapSize;)
    {
      const std::uint64_t index = Number(at, 2), size = Number(at + 8, 8);
      Require(at + 16, size);
      if (index == wanted)
      {
        const std::string text = Text(at + 16, std::min(length, size));
        return text.substr(0, text.find('\0'));
      }
      if (index == 0)  // free space, the last
      {
        break;
      }
      at += 16 + (size + 7) / 8 * 8;
    }
    Refuse("a text is missing");
  }

private:
  void Require(std::uint64_t at, std::uint64_t size) const
  {
    bigus::Require(FileFault::Truncated, at <= bytes_.size() && size <= bytes_.size() - at, name_,
                   ": the HDF5 file ends before what it refers to; it is truncated or damaged");
  }

  const std::string& name_;
  std::string bytes_;
  std::uint64_t root_ = 0;
};

}  // namespace

bool LooksLikeHdf5(const std::string& beginning)
{
  return beginning.compare(0, kMagic.size(), kMagic) == 0;
}

std::vector<TransformEntry> ReadHdf5Transforms(const std::string& fileName)
{
  const File file(fileName);
  const std::uint64_t group = file.Find(file.Root(), "TransformGroup");
  file.RequireKind(group != kUndefined, "it has no TransformGroup");
  std::vector<TransformEntry> entries;
  for (std::size_t k = 0;; ++k)
  {
    const std::uint64_t transform = file.Find(group, std::to_string(k));
    if (transform == kUndefined)
    {
      return entries;
    }
    file.RequireKind(k != mostTransforms, "it has more than ", mostTransforms, " transforms");
    const auto numbers = [&](const std::string& name)
    {
      std::uint64_t found = file.Find(transform, "Transform" + name);
      found = found != kUndefined ? found : file.Find(transform, "Tranform" + name);  // as ITK before 5 spelled it
      return found == kUndefined ? std::vector<double>() : file.Numbers(found);
    };
    const std::uint64_t type = file.Find(transform, "TransformType");
    file.RequireKind(type != kUndefined, "TransformGroup/", k, " has no TransformType");
    entries.push_back({file.Word(type), numbers("Parameters"), numbers("FixedParameters")});
  }
}

}  // namespace bigus
