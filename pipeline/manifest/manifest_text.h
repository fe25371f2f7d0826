// pipeline/manifest/manifest_text.h: the text of a manifest for writer and reader: head, tail, and a layer's line, described
// once.
#pragma once

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

#include "pipeline/manifest/manifest.h"
#include "stages/data/layer.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/json_text.h"

namespace lamina {

/// The head without the fields that differ between shards of a job; its hash is the job's id.
std::string lasting_text(const ManifestHead& head);

/// The text up to the first layer, without a line end.
std::string head_text(const ManifestHead& head);

/// The text after the last layer. file  the single file of all layers, if the head names one
std::string tail_text(const ManifestHead& head, const FileDigest& file);

/// Reads the output of head_text(). errors  kVerification: the reason, without a place
Result<ManifestHead> read_head(const std::string& text);

/// Reads the output of tail_text() without its first line. errors  false for any other text
bool read_tail(const ManifestHead& head, const std::string& text, FileDigest& file);

// --- what a manifest says is held against what lamina can have written.
//
// The id of a manifest is no signature: anybody can write one that holds together. Names of files are made of what stands
// in it, so an extension "/../../x.tif" would lead out of the job's folder.

/// Empty, or what no layer, and no print program of one, that lamina writes has.
std::string what_is_impossible(const Layer& layer);
std::string what_is_impossible(const ProgramRecord& program);

// --- the line of a layer

/// Appends the pieces of a line.
class LineWriter {
 public:
  explicit LineWriter(std::string& out) : out_(out) {}
  template <class Number>
  void number(std::string_view key, const Number& value) {
    begin(key);
    char text[32];
    out_.append(text, fmt::format_to(text, FMT_COMPILE("{}"), value));
  }
  /// A text determined by the rest of the line.
  void fixed(std::string_view key, std::string_view value) {
    begin(key);
    out_ += json_string(value);
  }
  void hash(std::string_view key, const Hash128& value) {
    begin(key);
    char text[40];
    out_.append(text, fmt::format_to(text, FMT_COMPILE("\"{:016x}{:016x}\""), value.high, value.low));
  }
  template <class Number>
  void added_number(std::string_view key, const Number& value) {
    number(key, value);
  }
  void reason(std::string_view key, const LayerReason& value) { fixed(key, reason_name(value)); }
  /// A list of objects, left out if it is empty. describe(item) writes the numbers of one.
  template <class List, class Describe>
  void list(std::string_view key, const List& items, Describe describe) {
    if (items.empty()) return;
    open(key, "[");
    for (const auto& item : items) {
      open("", "{");
      describe(item);
      close("}");
    }
    close("]");
  }
  /// Opens an object or a list under a key, or as a list element if the key is empty.
  void open(std::string_view key, std::string_view bracket) {
    if (!key.empty()) {
      begin(key);
    } else if (!first_) {
      out_ += ", ";
    }
    out_ += bracket;
    first_ = true;
  }
  void close(std::string_view bracket) {
    out_ += bracket;
    first_ = false;
  }

 private:
  void begin(std::string_view key) {
    if (!first_) out_ += ", ";
    out_ += '"';
    out_ += key;
    out_ += "\": ";
    first_ = false;
  }
  std::string& out_;
  bool first_ = true;
};

/// Consumes the pieces of a line from the front; what() describes its error.
class LineReader {
 public:
  explicit LineReader(std::string_view line) : rest_(line) {}
  template <class Number>
  void number(std::string_view key, Number& value) {
    begin(key);
    const auto [stop, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    expect(error == std::errc());
    if constexpr (std::is_floating_point_v<Number>) expect(std::isfinite(value));
    if (good()) rest_.remove_prefix(static_cast<std::size_t>(stop - rest_.data()));
  }
  /// A number that records of earlier builds do not have; it stays as it is then.
  template <class Number>
  void added_number(std::string_view key, Number& value) {
    if (follows(key)) number(key, value);
  }
  void fixed(std::string_view key, std::string_view value) {
    begin(key);
    if (good() && !take(json_string(value))) what_ = fmt::format("its \"{}\" is not {}", key, value);
  }
  void hash(std::string_view key, Hash128& value) {
    begin(key);
    expect(take("\""));
    if (good() && !read_hex(rest_.substr(0, 32), value)) what_ = "has a hash that is none";
    rest_.remove_prefix(std::min<std::size_t>(32, rest_.size()));
    expect(take("\""));
  }
  void reason(std::string_view key, LayerReason& value) {
    begin(key);
    for (const LayerReason one :
         {LayerReason::kUniform, LayerReason::kSlope, LayerReason::kPeak, LayerReason::kCusp, LayerReason::kFlat}) {
      if (!take(fmt::format("\"{}\"", reason_name(one)))) continue;
      value = one;
      return;
    }
    if (good()) what_ = "has a reason that is none";
  }
  template <class List, class Describe>
  void list(std::string_view key, List& items, Describe describe) {
    if (!follows(key)) return;
    open(key, "[");
    while (good() && !rest_.starts_with(']')) {
      open("", "{");
      describe(items.emplace_back());
      close("}");
    }
    close("]");
  }
  void open(std::string_view key, std::string_view bracket) {
    if (!key.empty()) {
      begin(key);
    } else if (!first_) {
      expect(take(", "));
    }
    expect(take(bracket));
    first_ = true;
  }
  void close(std::string_view bracket) {
    expect(take(bracket));
    first_ = false;
  }
  bool good() const { return what_.empty(); }
  const std::string& what() const { return what_; }
  bool ended() const { return rest_.empty(); }

 private:
  void begin(std::string_view key) {
    if (!first_) expect(take(", "));
    expect(take("\"") && take(key) && take("\": "));
    first_ = false;
  }
  /// Whether a number under that key comes next in an object that has begun.
  bool follows(std::string_view key) const {
    return rest_.starts_with(", \"") && rest_.substr(3).starts_with(key) && rest_.substr(3 + key.size()).starts_with("\": ");
  }
  bool take(std::string_view piece) {
    if (!rest_.starts_with(piece)) return false;
    rest_.remove_prefix(piece.size());
    return true;
  }
  void expect(bool holds) {
    if (!holds && what_.empty()) what_ = "is not the line of a layer";
  }
  std::string_view rest_;
  std::string what_;
  bool first_ = true;
};

template <class Io, class Pores>
void describe_pores(Io& io, Pores& pores) {
  io.number("pores", pores.closed);
  io.number("pores_open", pores.open);
  io.number("pores_filled", pores.filled);
  io.number("pores_at_edges", pores.edges);
  io.number("pores_length_mm", pores.length_mm);
  io.number("pores_width_mm", pores.width_mm);
  io.number("pores_distance_mm", pores.distance_mm);
  io.number("crossing", pores.crossing);
  io.number("crossed", pores.crossed);
}

template <class Io, class Paths>
void describe_moves(Io& io, Paths& paths) {
  auto& t = paths.totals;
  io.number("stored_points", paths.stored_points);
  io.number("moves", t.moves);
  io.number("travels", t.travels);
  io.number("retractions", t.retractions);
  io.number("deposited_mm", t.bead_mm);
  io.number("travel_mm", t.travel_mm);
  io.number("volume_mm3", t.volume_mm3);
  io.number("auxiliary_mm3", t.auxiliary_mm3);
  io.number("filament_mm", t.filament_mm);
  io.number("seconds", t.seconds);
  io.number("low_x_nm", t.lo_x);
  io.number("low_y_nm", t.lo_y);
  io.number("high_x_nm", t.hi_x);
  io.number("high_y_nm", t.hi_y);
  io.number("auxiliary_moves", t.auxiliary_moves);
  io.number("auxiliary_mm", t.auxiliary_mm);
  io.number("auxiliary_filament_mm", t.auxiliary_filament_mm);
  io.added_number("last_x_nm", t.last.x);
  io.added_number("last_y_nm", t.last.y);
  auto& deposited = paths.deposited;
  io.number("segmented_lines", deposited.segments.lines);
  io.number("pieces", deposited.segments.pieces);
  io.number("intervals", deposited.segments.intervals);
  io.number("thin", deposited.segments.thin);
  io.number("solid_mm3", deposited.porosity.solid_mm3);
  io.number("extruded_mm3", deposited.porosity.extruded_mm3);
  io.number("measured_mm3", deposited.porosity.measured_mm3);
  describe_pores(io, deposited.pores);
  io.number("too_short", deposited.shorts.count);
  io.number("shortest_mm", deposited.shorts.shortest_mm);
  io.number("reached_mm_s", deposited.shorts.reached_mm_s);
  io.number("commanded_mm_s", deposited.shorts.commanded_mm_s);
  io.list("ranges", paths.by_range, [&](auto& range) {
    io.number("area_mm2", range.area_mm2);
    describe_pores(io, range.pores);
  });
}

template <class Io, class Paths>
void describe_paths(Io& io, Product product, Paths& paths) {
  io.number("contours", paths.contours);
  io.number("points", paths.points);
  io.number("area_mm2", paths.area_mm2);
  io.number("paths", paths.paths);
  if (product == Product::kContours) io.number("bead_mm", paths.bead_mm);
  io.number("merged", paths.merged);
  io.number("open", paths.open);
  if (product == Product::kMoves) describe_moves(io, paths);
}

template <class Io, class Record>
void describe_images(Io& io, const ManifestHead& head, Record& record) {
  io.number("capped_rows", record.capped_rows);
  if (head.max_drops > 0 || head.levels > 0) io.number("dosed_pixels", record.dosed_pixels);
  if (head.max_drops > 0) {
    io.number("drops", record.drops);
    io.number("requested_drops", record.requested_drops);
    if (head.grey_drops() || head.drops_of_materials() || head.geometry) io.number("max_drops", record.max_drops);
  }
  if (head.geometry) io.number("geometry_pixels", record.geometry_pixels);
  if (head.levels > 0) {
    io.number("half_differs", record.half_differs);
    io.number("half_far", record.half_far);
  }
  if (head.named_images() == 0 || head.drops_of_materials()) io.number("set_pixels", record.set_pixels);
  if (head.named_images() > 0) {
    io.open("images", "[");
    for (std::size_t m = 0; m < head.named_images(); ++m) {
      auto& image = record.images[m];
      io.open("", "{");
      io.fixed("file", layer_file_name(record.layer.index, head.extension, head.image_name(m)));
      io.number("bytes", image.bytes);
      io.number("set_pixels", image.set_pixels);
      if (head.grey_drops()) io.number("drops", image.drops);
      if (!head.machine.empty()) io.number("unfed_pixels", image.unfed_pixels);
      io.hash("xxh3_128", image.hash);
      io.close("}");
    }
    io.close("]");
  }
  io.list("part_pixels", record.part_pixels, [&](auto& pixels) { io.number("set", pixels); });
  io.list("part_drops", record.part_drops, [&](auto& drops) { io.number("drops", drops); });
  if (head.machine.empty()) return;
  io.open("program", "{");
  io.number("bytes", record.program.bytes);
  io.number("sweeps", record.program.sweeps);
  io.number("drops", record.program.drops);
  io.number("moved", record.program.moved);
  io.number("lost", record.program.lost);
  io.number("microseconds", record.program.microseconds);
  io.number("spat", record.program.spat);
  if (head.head_drops > 1) {
    io.number("added_sweeps", record.program.added_sweeps);
    io.number("added_microseconds", record.program.added_microseconds);
  }
  io.hash("xxh3_128", record.program.hash);
  io.close("}");
}

/// When reading, record.images must already have head.named_images() entries. `paths` is unused for images.
template <class Io, class Record, class Paths>
void describe_line(Io& io, const ManifestHead& head, Record& record, Paths& paths) {
  io.open("", "{");
  io.number("index", record.layer.index);
  if (!head.extension.empty() && head.named_images() == 0) {
    io.fixed("file", layer_file_name(record.layer.index, head.extension));
  }
  io.number("bottom_nm", record.layer.bottom);
  io.number("thickness_nm", record.layer.thickness);
  io.reason("reason", record.layer.reason);
  if (head.named_images() == 0) {
    if (!head.file.empty()) io.number("offset", record.offset);
    io.number("bytes", record.bytes);
    io.hash("xxh3_128", record.hash);
  }
  if (head.product == Product::kImages) {
    describe_images(io, head, record);
  } else {
    describe_paths(io, head.product, paths);
  }
  io.close("}");
}

}  // namespace lamina
