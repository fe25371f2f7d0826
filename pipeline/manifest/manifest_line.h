// pipeline/manifest/manifest_line.h: a layer's line in a manifest, described once for writer and reader.
#pragma once

#include <string_view>

#include "pipeline/manifest/line_io.h"
#include "pipeline/manifest/manifest.h"

namespace lamina {

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
  io.number("laid_mm", t.bead_mm);
  io.number("travel_mm", t.travel_mm);
  io.number("volume_mm3", t.volume_mm3);
  io.number("beside_mm3", t.beside_mm3);
  io.number("filament_mm", t.filament_mm);
  io.number("seconds", t.seconds);
  io.number("low_x_nm", t.lo_x);
  io.number("low_y_nm", t.lo_y);
  io.number("high_x_nm", t.hi_x);
  io.number("high_y_nm", t.hi_y);
  io.number("beside_moves", t.beside_moves);
  io.number("beside_mm", t.beside_mm);
  io.number("beside_filament_mm", t.beside_filament_mm);
  auto& laid = paths.laid;
  io.number("segmented_lines", laid.segments.lines);
  io.number("pieces", laid.segments.pieces);
  io.number("stretches", laid.segments.stretches);
  io.number("thin", laid.segments.thin);
  io.number("solid_mm3", laid.porosity.solid_mm3);
  io.number("extruded_mm3", laid.porosity.extruded_mm3);
  io.number("measured_mm3", laid.porosity.measured_mm3);
  describe_pores(io, laid.pores);
  io.number("too_short", laid.shorts.count);
  io.number("shortest_mm", laid.shorts.shortest_mm);
  io.number("reached_mm_s", laid.shorts.reached_mm_s);
  io.number("told_mm_s", laid.shorts.told_mm_s);
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
  io.number("united", paths.united);
  io.number("open", paths.open);
  if (product == Product::kMoves) describe_moves(io, paths);
}

template <class Io, class Record>
void describe_images(Io& io, const ManifestHead& head, Record& record) {
  io.number("capped_rows", record.capped_rows);
  if (head.most_drops > 0 || head.levels > 0) io.number("dosed_pixels", record.dosed_pixels);
  if (head.most_drops > 0) {
    io.number("drops", record.drops);
    io.number("asked_drops", record.asked_drops);
    if (head.grey_drops() || head.drops_of_materials()) io.number("most_drops", record.most_drops);
  }
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
