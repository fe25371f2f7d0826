// stages/arrange/placement.h: where boxes stand on the bed.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::arrange {

/// The box of one [[part]] and how many of it have to stand.
struct BoxRequest {
  std::int64_t width = 0, depth = 0;  // nm
  std::uint32_t copies = 1;
  std::optional<std::int64_t> at_x = {}, at_y = {};  // nm; both or none
  std::string name = {};                             // for messages
};

/// Where boxes may stand.
struct BedSpace {
  std::int64_t width = 0, depth = 0;  // nm
  std::int64_t margin = 0;            // nm along each side, where nothing is arranged
  bool of_machine = false;            // it is that of a machine, so that advice names no other size of it
};

/// The front left corner of one copy.
struct BoxPosition {
  std::uint32_t request;  // index of its BoxRequest
  std::int64_t x, y;      // nm
};

/// Places all copies, in the order of the requests.
///
/// A request with a position gets it for its first copy; further ones follow along x, their width and the gap apart.
/// The others fill rows from the left, `gap` apart; a row is as deep as its deepest box, and the next one begins
/// behind it. The block of all rows is centred on the bed, rounded down, and stays out of its margin. No box is turned.
///
/// errors  kUsage if a copy does not lie within the bed or its margin: which, by how much, and what would help
/// cost    O(copies)
Result<std::vector<BoxPosition>> arrange_boxes(std::span<const BoxRequest> requests, const BedSpace& bed, std::int64_t gap);

}  // namespace lamina::arrange
