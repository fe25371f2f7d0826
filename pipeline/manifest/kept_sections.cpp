#include "pipeline/manifest/kept_sections.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"

namespace lamina {
namespace {

constexpr std::array<std::string_view, 1> kFrame = {"^\x28\xB5\x2F\xFD"};  // the first bytes of Zstandard
constexpr std::uint64_t kMaxBlock = std::uint64_t{1} << 36;

void add_number(std::uint64_t number, Buffer<std::byte>& block) {
  for (; number >= 128; number >>= 7) block.push_back(static_cast<std::byte>(number | 128));
  block.push_back(static_cast<std::byte>(number));
}

bool take_number(std::span<const std::byte>& block, std::uint64_t& number) {
  number = 0;
  for (unsigned shift = 0; !block.empty() && shift < 63; shift += 7) {
    const auto byte = static_cast<std::uint64_t>(block.front());
    block = block.subspan(1);
    number |= (byte & 127) << shift;
    if (byte < 128) return true;
  }
  return false;
}

bool take_image(std::span<const std::byte>& block, const PixelGrid& grid, Runs& image) {
  image.columns = grid.columns();
  image.row_offset.assign(1, 0);
  std::uint64_t row = 0, step = 0, runs = 0;
  const auto so_far = [&] { return static_cast<std::uint32_t>(image.change.size()); };
  for (;;) {
    if (!take_number(block, step) || step > grid.rows() - row) return false;
    if (step == 0) break;
    row += step;
    image.row_offset.resize(row, so_far());
    if (!take_number(block, runs)) return false;
    std::uint64_t column = 0;
    for (std::uint64_t i = 0; i < 2 * runs; ++i) {
      if (!take_number(block, step) || step > grid.columns() - column || (step == 0 && i > 0)) return false;
      image.change.push_back(static_cast<std::uint32_t>(column += step));
    }
    image.row_offset.push_back(so_far());
  }
  image.row_offset.resize(std::size_t{grid.rows()} + 1, so_far());
  return true;
}

Json json_of(const SectionsHead& head) {
  Json json{{"kind", "sections"},      {"job", head.job},     {"min_wall_mm", head.min_mm}, {"min_drain_mm", head.drain_mm},
            {"bytes", head.max_bytes}, {"parts", head.parts}, {"placed", Json::array()}};
  for (const auto& [box, part, group, mesh_mm3, closed] : head.placed)
    json["placed"].push_back(Json::array({box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z, part}));
  return json;
}

/// errors  throws JsonError
SectionsHead head_of(const Json& json) {
  SectionsHead head;
  json.at("job").get_to(head.job);
  json.at("min_wall_mm").get_to(head.min_mm);
  json.at("min_drain_mm").get_to(head.drain_mm);
  json.at("bytes").get_to(head.max_bytes);
  json.at("parts").get_to(head.parts);
  for (const Json& one : json.at("placed")) {
    const auto nm = [&](std::size_t i) { return one.at(i).get<Nm>(); };
    head.placed.push_back({{{nm(0), nm(1), nm(2)}, {nm(3), nm(4), nm(5)}}, one.at(std::size_t{6}).get<std::uint32_t>()});
  }
  return head;
}

std::optional<SectionsHead> read_head(std::span<const std::byte> block) {
  const std::string_view text(reinterpret_cast<const char*>(block.data()), block.size());
  try {
    if (json_nests_within(text)) return head_of(parse_json(text));
  } catch (const JsonError&) {
  }
  return std::nullopt;
}

}  // namespace

std::string sections_path(const std::string& manifest) {
  std::filesystem::path path(manifest);
  const std::string name = path.stem().string();
  return path.replace_filename("inspection" + name.substr(std::string_view("manifest").size()) + ".zst").string();
}

Status open_sections(const std::string& path, const SectionsHead& head, const FileOptions& options, ContentWriter& file) {
  if (!is_replaceable(path, kFrame))
    return Error{Fault::kUsage, fmt::format("{}: is there already, and lamina did not write it; remove it", path)};
  if (Status status = file.open(path, options); !status) return status;
  const std::string text = json_line(json_of(head));
  return append_block(std::as_bytes(std::span(text)), file);
}

Status append_block(std::span<const std::byte> block, ContentWriter& file) {
  const std::uint64_t size = block.size();
  const Hash128 hash = hash_bytes(block);
  for (const std::uint64_t number : {size, hash.high, hash.low}) {
    if (Status status = file.append(std::as_bytes(std::span(&number, 1))); !status) return status;
  }
  return file.append(block);
}

void add_image(const RunsView& image, Buffer<std::byte>& block) {
  std::uint32_t before = 0;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = image.row(r);
    if (row.empty()) continue;
    add_number(r + 1 - std::exchange(before, r + 1), block);
    add_number(row.size() / 2, block);
    std::uint32_t column = 0;
    for (const std::uint32_t change : row) add_number(change - std::exchange(column, change), block);
  }
  add_number(0, block);
}

std::optional<Section> section_of(std::span<const std::byte> block, const PixelGrid& grid) {
  Section section;
  if (!take_image(block, grid, section.image)) return std::nullopt;
  section.has_samples = !block.empty();
  const bool whole = !section.has_samples || (take_image(block, grid, section.sampled) && block.empty());
  return whole ? std::optional(std::move(section)) : std::nullopt;
}

Status read_sections(const std::string& path, const PixelGrid& grid, const std::function<Status(SectionsHead)>& take_head,
                     const std::function<Status(Section)>& take) {
  std::array<std::uint64_t, 3> frame{};  // length, hash
  Buffer<std::byte> block;
  bool headless = true;
  const Error damaged{Fault::kVerification, path + ": is damaged"};
  const auto end_block = [&]() -> Status {
    if (hash_bytes(block) != Hash128{frame[1], frame[2]}) return damaged;
    if (std::exchange(headless, false)) {
      auto head = read_head(block);
      return head ? take_head(std::move(*head)) : Status(damaged);
    }
    auto section = section_of(block, grid);
    return section ? take(std::move(*section)) : Status(damaged);
  };
  std::size_t framed = 0;  // bytes of the frame so far
  const Status status = expand_file(path, UINT64_MAX, [&](std::span<const std::byte> piece) -> Status {
    while (!piece.empty()) {
      const bool in_frame = framed < sizeof frame;
      const std::size_t count = std::min<std::size_t>(piece.size(), in_frame ? sizeof frame - framed : frame[0] - block.size());
      if (in_frame) {
        std::memcpy(reinterpret_cast<std::byte*>(frame.data()) + framed, piece.data(), count);
        framed += count;
        if (framed == sizeof frame && (frame[0] == 0 || frame[0] > kMaxBlock)) return damaged;
      } else {
        block.insert(block.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
      }
      piece = piece.subspan(count);
      if (framed < sizeof frame || block.size() < frame[0]) continue;
      if (Status ended = end_block(); !ended) return ended;
      block.clear();
      framed = 0;
    }
    return {};
  });
  return status && (headless || framed > 0) ? Status(damaged) : status;
}

void remove_sections(const std::string& manifest) {
  const std::string path = sections_path(manifest);
  if (is_file(path) && is_replaceable(path, kFrame)) remove_or_note(path);
}

}  // namespace lamina
