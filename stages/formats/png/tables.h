// stages/formats/png/tables.h: the codes of images, one of which is taken by how much of the image changes.
#pragma once

#include <cstdint>

#include "stages/formats/png/block_head.h"
#include "stages/formats/png/codes.h"

namespace lamina::write::png {

struct Table {
  Codes codes;
  BlockHead head;
};

/// For rows of this many bytes that change colour this often in all.
const Table& table_for(std::uint64_t bytes, std::uint64_t changes);

}  // namespace lamina::write::png
