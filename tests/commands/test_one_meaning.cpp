// One word means one thing: on a command line and in a file, in every command, and in what is answered where.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

struct OneMeaning : testing::Test {
  Directory folder;
  void SetUp() override { write_box(folder / "part.stl", {0, 0, 0}, {12, 10, 4}); }
  Outcome run(const std::string& line) const { return run_lamina(words_of(line), folder.path()); }
  /// The call ends well.
  Outcome done(const std::string& line) const {
    Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    return outcome;
  }
};

TEST_F(OneMeaning, AJobFileAndACommandLineOfTheSameWordsGiveTheSameToolpaths) {
  const struct {
    const char *words, *file;  // next to the part
  } rows[] = {
      {"", ""},
      {"--machine anet-a8", "[machine]\nprofile = 'anet-a8'\n"},
      {"--layer 0.05", "[layers]\nthickness_mm = 0.05\n"},
      {"--walls 0 --pattern raster", "[fill]\nwalls = 0\npattern = 'raster'\n"},
      {"--pattern raster --line-distance 2", "[fill]\npattern = 'raster'\ndistance_mm = 2\n"},
      {"--fill segmented --machine anet-a8", "[machine]\nprofile = 'anet-a8'\n[segment]\non = true\n"},
      {"--heights cusp --thickness 0.1,0.2", "[heights]\nmode = 'cusp'\nthickness_mm = '0.1,0.2'\n"},
  };
  for (const auto& row : rows) {
    write_text(folder / "job.toml", std::string("[[part]]\npath = 'part.stl'\n") + row.file);
    done(std::string("extrude part.stl --quiet --overwrite -o a.gcode ") + row.words);
    done("extrude --job job.toml --quiet --overwrite -o b.gcode");
    EXPECT_EQ(read_text(folder / "a.gcode"), read_text(folder / "b.gcode")) << row.words;
    EXPECT_NE(read_text(folder / "b.gcode").find("G1"), std::string::npos);
  }
  const auto layers = [&](const std::string& line) {
    return nlohmann::json::parse(done("extrude --dry-run --quiet --json " + line).out)["layers_total"].get<int>();
  };
  EXPECT_EQ(layers("part.stl"), 20) << "4 mm in layers of half of the nozzle";
  EXPECT_EQ(layers("part.stl --set layers.thickness_mm=0.1"), 40);
}

// The same words for bitmaps, slices and tables; saved jobs give them once more.
TEST_F(OneMeaning, AJobFileACommandLineAndASavedJobAgreeInEveryCommand) {
  const struct {
    const char *command, *words, *file;
  } rows[] = {
      {"jet", "--bed 60x50 --dpi 100x200 --layer 1 --mirror x --format png",
       "[bed]\nsize_mm = [60, 50]\ndpi = [100, 200]\n[layers]\nthickness_mm = 1\n[image]\nmirror = 'x'\nformat = 'png'\n"},
      {"jet", "--bed 40x40 --dpi 200 --layer 1 --fill segmented --thin 2 --shell 1",
       "[bed]\nsize_mm = [40, 40]\ndpi = 200\n[layers]\nthickness_mm = 1\n[segment]\non = true\nthin_mm = 2\n"
       "[dose]\nshell_mm = 1\n"},
      {"jet", "--machine nuferbj --layer 1 --blocked 3,4 --bleed 50x80",
       "[machine]\nprofile = 'nuferbj'\nblocked = [3, 4]\n[layers]\nthickness_mm = 1\n[dose]\nbleed_um = [50, 80]\n"},
      {"slice", "--layer 1 --format cli --empty-first-layer --fill raster --bead-gap 0.3,0.1 --angle 30",
       "[layers]\nthickness_mm = 1\n[slice]\nformat = 'cli'\nempty_first_layer = true\n[fill]\npattern = 'raster'\n"
       "gap_mm = [0.3, 0.1]\nangle_deg = 30\n"},
      {"slice", "--layer 1 --walls 2 --fill none --offset 0.1 --tolerance 5",
       "[layers]\nthickness_mm = 1\n[fill]\nwalls = 2\n[slice]\noffset_mm = 0.1\ntolerance_um = 5\n"},
      {"heights", "--heights angle --thickness 0.5,1 --adapt-angle 30 --cover-top",
       "[heights]\nmode = 'angle'\nthickness_mm = '0.5,1'\nadapt_angle_deg = 30\ncover_top = true\n"},
  };
  for (const auto& row : rows) {
    const std::string command = row.command, words = std::string(" ") + row.words;
    const bool table = command == "heights";
    const std::string end = table ? ".txt" : "";
    write_text(folder / "job.toml", std::string("[[part]]\npath = 'part.stl'\n") + row.file);
    done(command + " part.stl --quiet --overwrite -o a" + end + words);
    done(command + " --job job.toml --quiet --overwrite -o b" + end);
    done(command + " part.stl --quiet --save-job saved.toml" + (table ? " -o x.txt --overwrite" : " --dry-run") + words);
    done(command + " --job saved.toml --quiet --overwrite -o c" + end);
    const auto bytes = [&](const std::string& name) {
      if (table) return read_text(folder / (name + end));
      std::filesystem::remove(folder.path() / name / "job.toml");
      return tree_text(folder.path() / name);
    };
    EXPECT_EQ(bytes("a"), bytes("b")) << command << words;
    EXPECT_EQ(bytes("a"), bytes("c")) << command << words << ", saved";
  }
}

// A default that is stated is no other job to resume or to merge.
TEST_F(OneMeaning, ContentOfImagesThatIsTheDefaultMakesTheSameJob) {
  const struct {
    const char *words, *same, *images_of;
  } rows[] = {
      {"--bed 30x30 --dpi 100", "auto,drops", "geometry"},
      {"--bed 30x30 --dpi 100 --shell 1 --core 0.5", "auto,drops", "drops"},
      {"--bed 30x30 --dpi 100 --levels 4 --format tiff-4", "auto,drops", "levels"},
      {"--machine nuferbj", "auto,geometry,drops", "geometry"},
      {"--machine nuferbj --bleed 50", "auto,geometry,drops", "geometry"},
      {"--machine nuferbj --saturation 40", "auto,geometry", "geometry"},
      {"--machine nuferbj --shell 1 --core 0.5", "auto,geometry", "geometry"},
      {"--machine nuferbj --saturation 40 --format tiff-8", "auto,drops", "drops"},
      {"--machine nuferbj --levels 4", "auto,drops", "drops"},
      {"--machine nuferbj --saturation 40*x/x", "auto,drops", "drops"},
  };
  for (const auto& row : rows) {
    const std::string job = std::string("jet part.stl --layer 1 ") + row.words;
    const auto json = nlohmann::json::parse(done(job + " --quiet --json --overwrite -o a").out);
    EXPECT_EQ(json["images_of"], row.images_of) << row.words;
    const std::string whole = tree_text(folder.path() / "a"), manifest = read_text(folder / "a/manifest.json");
    const bool geometry = manifest.find("\"images_of\": \"geometry\"") != std::string::npos;
    EXPECT_TRUE(!geometry || json["images_of"] == "geometry") << row.words;
    for (const std::string images : {"auto", "geometry", "drops"}) {
      const std::string stated = job + " --quiet --images " + images;
      const bool same = std::string(row.same).find(images) != std::string::npos;
      const Outcome outcome = run(stated + " --resume -o a");
      EXPECT_EQ(outcome.code, same ? 0 : 2) << stated << "\n" << outcome.err;
      EXPECT_EQ(tree_text(folder.path() / "a"), whole) << stated;
      done("jet part.stl --layer 1 " + std::string(row.words) + " --quiet --overwrite --shard 1/2 -o b1");
      if (!same) continue;
      done(stated + " --overwrite --shard 2/2 -o b2");
      done("merge b1 b2 -o b --quiet");
      EXPECT_EQ(tree_text(folder.path() / "b"), whole) << stated;
      for (const char* left : {"b", "b1", "b2"}) std::filesystem::remove_all(folder.path() / left);
    }
    std::filesystem::remove_all(folder.path() / "b1");
  }
}

TEST_F(OneMeaning, ImagesOfTheGeometryAreNamedWhereTheyAreRead) {
  for (const std::string images : {"geometry", "drops"}) {
    done("jet part.stl --machine nuferbj --layer 1 --shell 1 --core 0.5 --quiet -o " + images + " --images " + images);
    const bool named = images == "geometry";
    EXPECT_EQ(done("info " + images).out.find("; geometry before the dose") != std::string::npos, named) << images;
    const Outcome converted = done("convert " + images + " --format png -o png-" + images);
    EXPECT_EQ(converted.err.find("note: images of geometry are the geometry before the dose") != std::string::npos, named)
        << converted.err;
  }
  const Outcome manifest = run("verify geometry/manifest.json");
  EXPECT_EQ(manifest.code, 2);
  EXPECT_NE(manifest.err.find("geometry/manifest.json: is the manifest of a job; name its directory"), std::string::npos);
}

TEST_F(OneMeaning, ASavedJobOfHeightsIsTheOneRequested) {
  done("heights part.stl --compare --thickness 0.5,1 --quiet -o table --save-job saved.toml");
  const std::string saved = read_text(folder / "saved.toml");
  EXPECT_NE(saved.find("size_mm = [490, 380]"), std::string::npos) << saved;
  EXPECT_NE(saved.find("mode = \"uniform\""), std::string::npos) << saved;
}

TEST_F(OneMeaning, AFillingOfTheCommandLineReplacesSegmentedLinesOfAFile) {
  write_text(folder / "job.toml", "[machine]\nprofile = 'anet-a8'\n[segment]\non = true\n[[part]]\npath = 'part.stl'\n");
  const auto summary = [&](const std::string& words) {
    return done("extrude --job job.toml --layer 0.3 --dry-run " + words).err;
  };
  EXPECT_NE(summary("").find("segments  "), std::string::npos);
  EXPECT_EQ(summary("--fill raster").find("segments  "), std::string::npos);
  EXPECT_EQ(summary("--fill none").find("segments  "), std::string::npos);
  EXPECT_NE(summary("--fill segmented").find("segments  "), std::string::npos);
  for (const char* line : {"extrude --job job.toml --dry-run --pattern none",
                           "jet part.stl --layer 1 --dry-run --fill segmented --pattern none"}) {
    const Outcome refused = run(line);
    EXPECT_EQ(refused.code, 2) << line;
    EXPECT_NE(refused.err.find("--pattern: none, but lines are segmented"), std::string::npos) << refused.err;
  }
}

// [slice] is of contours and toolpaths; a manifest of images does not hold it, so that it must not change them.
TEST_F(OneMeaning, KeysOfContoursDoNotMoveFilledImages) {
  const std::string call = "jet part.stl --bed 40x40 --dpi 200 --layer 1 --fill raster --bead-gap 0.3 --quiet -o ";
  done(call + "plain");
  const Outcome moved = done(call + "moved --set slice.offset_mm=0.5");
  EXPECT_EQ(tree_text(folder.path() / "plain"), tree_text(folder.path() / "moved"));
  const Outcome reported = done("jet part.stl --layer 1 --dry-run --set slice.offset_mm=0.5");
  EXPECT_NE(reported.err.find("note: --set slice.offset_mm=0.5: slice.offset_mm decides nothing here"), std::string::npos)
      << reported.err;
}

TEST_F(OneMeaning, FillIsWhatIsDepositedInside) {
  for (const std::string command : {"jet", "slice", "extrude"}) {
    const std::string call = command + " part.stl --layer 0.3 --dry-run --quiet ";
    done(call + "--fill raster");
    done(call + "--fill-rule evenodd");
    const Outcome refused = run(call + "--fill evenodd");
    EXPECT_EQ(refused.code, 2);
    EXPECT_NE(refused.err.find("--fill-rule evenodd"), std::string::npos) << refused.err;
  }
  done("jet part.stl --layer 1 --dry-run --quiet --fill segmented");
  EXPECT_NE(run("slice part.stl --layer 1 --dry-run --fill segmented").err.find("lamina extrude and lamina jet"),
            std::string::npos);
  EXPECT_NE(run("jet part.stl --fill sparkle --dry-run").err.find("raster, contour"), std::string::npos);
}

TEST_F(OneMeaning, OptionsThatDoNothingHereAreRefused) {
  done("jet part.stl --bed 60x60 --dpi 100 --layer 1 --quiet -o out");
  done("extrude part.stl --quiet -o beads.gcode");
  const struct {
    const char *line, *words;
  } rows[] = {
      {"jet part.stl --dry-run --no-repair --weld 5", "--weld: applies to repair"},
      {"jet part.stl --dry-run --no-repair --repair winding", "--no-repair and --repair exclude each other"},
      {"jet part.stl --dry-run --at 1,1 --gap 3", "--gap: applies to several parts"},
      {"slice part.stl --dry-run --layer 1 --empty-first-layer", "--empty-first-layer: applies to CLI files"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --fan 50", "--fan: is not in SML"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --nozzle-temperature 200",
       "--nozzle-temperature: is not in SML"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --fill raster --print-speed 9",
       "--print-speed: is not in SML"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --wall-speed 9", "--wall-speed: is not in SML"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --travel-speed 9", "--travel-speed: is not in SML"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --first-layer-speed 9",
       "--first-layer-speed: is not in SML"},
      {"slice part.stl --dry-run --heights optimal --thickness 0.5,1 --facets plane",
       "--facets: applies to --heights angle, cusp"},
      {"heights part.stl --heights optimal --thickness 0.5,1 --facets plane", "--facets: applies to --heights angle, cusp"},
      {"slice part.stl --dry-run --layer 1 --bridge 0.5", "--bridge: applies to open meshes"},
      {"extrude part.stl --dry-run --set fill.gap_mm=1 --print-speed 50", "--print-speed: applies to filling lines"},
      {"extrude part.stl --dry-run --machine anet-a8 --layer 0.3 --fill segmented --spacing-cc 0.5",
       "--spacing-cc: is between continuous lines"},
      {"extrude part.stl --dry-run --machine anet-a8 --fill segmented --pattern contour --segment-rule fukuda",
       "--segment-rule: applies to lines"},
      {"jet part.stl --dry-run --layer 1 --format png --title order", "--title: applies to TIFF"},
      {"heights part.stl --layer 1 --adapt-angle 30", "--adapt-angle: applies to --heights angle"},
      {"heights part.stl --layer 1 --time-model 3", "--time-model: applies to --heights optimal"},
      {"calibrate --machine anet-a8 --gap 0.1 -o pieces", "--gap: is of the profile"},
      {"calibrate --machine anet-a8 --exact-spacing -o pieces", "--exact-spacing: is of the profile"},
      {"preview out --step 3 -o a.png", "--step: needs a swath"},
      {"preview out --swath 1 --count 3 -o a.png", "--swath: is drawn in one layer"},
      {"permeability drops.csv --length 5 --area 3 --diameter 3", "--area and --diameter exclude each other"},
      {"permeability drops.csv --length 5 --area 3 --outlet-pressure 1e5", "--outlet-pressure: is of gases that expand"},
      {"permeability drops.csv --length 5 --area 3 --flow-pressure 1e5", "--flow-pressure: is of gases that expand"},
      {"permeability beads.gcode --compressible", "--compressible is for tables"},
      {"permeability drops.csv --voxel 5", "--voxel is for toolpaths"},
      {"permeability drops.csv --inertia", "--inertia is for toolpaths"},
      {"permeability beads.gcode --length 5", "--length is for tables"},
      {"permeability beads.gcode --window 2,3", "--window: want three lengths"},
      {"permeability beads.gcode --window 2,3,50", "--window: 50.000 mm along z are more than the print has"},
      {"permeability beads.gcode --window 90,3,1", "--window: 90.000 mm along x are more than the print has"},
      {"info part.stl --density 1.2", "--density: is of toolpaths"},
      {"info beads.gcode --scale 2", "--scale: is of parts"},
      {"design --machine anet-a8", "no target; add"},
      {"design --porosity 20", "--machine is missing"},
      {"design --porosity 20 --permeability 9 --pore 0.1x1 --machine anet-a8", "leave one out"},
      {"design --pore 0.9x0.12 --machine anet-a8", "--pore: 0.9 mm is the width and has to be less than the length"},
      {"design --pore 0.12 --machine anet-a8", "--pore: '0.12' is no width and length"},
      {"design --pore 0.12x0.9x3 --machine anet-a8", "--pore: '0.12x0.9x3' is no width and length"},
      {"design --pore 0.12xlong --machine anet-a8", "--pore: 'long'"},
      {"design --porosity 120 --machine anet-a8", "--porosity: 120"},
      {"design --permeability nan --machine anet-a8", "--permeability: 'nan'"},
      {"design --porosity 20 --machine fdm-2000", "--machine: fdm-2000 writes sml"},
      {"design --porosity 20 --machine ender", "--machine: no extrusion printer 'ender'"},
      {"design part.stl --porosity 20 --machine anet-a8", "'part.stl': not expected here"},
      {"info part.stl --repair off --weld 3", "--weld: applies to repair"},
      {"export part.stl --no-repair --weld 3 -o x.stl", "--weld: applies to repair"},
      {"export part.stl --at 1,1 --gap 3 -o x.stl", "--gap: applies to several parts"},
      {"report beads.gcode --parts part.stl -o a.html", "--parts: is of jobs of images"},
      {"preview beads.gcode --layer 2 --width 500 -o a.svg", "--width: applies to pictures of pixels"},
      {"slice part.stl --dry-run --layer 1 --pattern contour --angle 30", "--angle: applies to lines with a direction"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --machine-set fan.percent=50", "fan.percent: is not in SML"},
      {"extrude part.stl --dry-run --raft-gap 0.2", "--raft-gap: applies to a raft"},
      {"extrude part.stl --dry-run --raft 2 --elephant-foot 0.2", "--elephant-foot: applies to parts on the bed"},
      {"extrude part.stl --dry-run --machine fdm-2000 --layer 0.254 --machine-set material.bed_degc=50", "bed_degc: is not in SML"},
      {"extrude part.stl --dry-run --machine-set sml.height=x", "sml.height: is not in G-code"},
      {"manual jet -o pages", "--output: is for the pages of all commands"},
  };
  for (const auto& row : rows) {
    const Outcome refused = run(row.line);
    EXPECT_EQ(refused.code, 2) << row.line << "\n" << refused.err;
    EXPECT_EQ(refused.error_lines(), 1u) << refused.err;
    EXPECT_NE(refused.err.find(row.words), std::string::npos) << row.line << "\n" << refused.err;
  }
  for (const char* line :
       {"jet part.stl --dry-run --quiet --repair winding --weld 5", "jet part.stl --dry-run --quiet --copies 2 --gap 3",
        "slice part.stl --dry-run --quiet --layer 1 --format cli --empty-first-layer",
        "heights part.stl --compare --thickness 0.5,1 --time-model 3",
        "slice part.stl --dry-run --quiet --layer 1 --pattern contour+raster --angle 30",
        "extrude part.stl --dry-run --quiet --fan 50", "extrude part.stl --dry-run --quiet --wall-speed 50",
        "extrude part.stl --dry-run --quiet --fill raster --print-speed 50",
        "extrude part.stl --dry-run --quiet --machine fdm-2000 --layer 0.254 --machine-set speed.wall_mm_s=9",
        "extrude part.stl --dry-run --quiet --machine anet-a8 --layer 0.3 --fill segmented --continuous 2 --spacing-cc 0.5",
        "jet part.stl --dry-run --quiet --layer 1 --fill segmented --pattern honeycomb --segment-rule fukuda",
        "jet part.stl --dry-run --quiet --layer 1 --title order",
        "slice part.stl --dry-run --quiet --layer 1 --no-repair --bridge 0.5",
        "slice part.stl --dry-run --quiet --heights cusp --thickness 0.5,1 --facets plane"}) {
    done(line);
  }
  EXPECT_NE(done("jet part.stl --layer 1 --dry-run --walls 3").err.find("note: nothing is filled inside the walls"),
            std::string::npos);
  EXPECT_EQ(done("jet part.stl --layer 1 --dry-run --walls 3 --fill none").err.find("note:"), std::string::npos);
}

TEST_F(OneMeaning, WhatIsHarmlessButDoesNothingIsReported) {
  const std::string fitted = "jet part.stl --dry-run --heights cusp --thickness 0.5,1";
  EXPECT_NE(done(fitted + " --layer 1").err.find("note: --layer does nothing here"), std::string::npos);
  EXPECT_EQ(done(fitted).err.find("note:"), std::string::npos);
  EXPECT_NE(done("extrude part.stl --dry-run --set bed.dpi=600").err.find("note: --set bed.dpi=600: bed.dpi decides nothing"),
            std::string::npos);
  EXPECT_EQ(done("extrude part.stl --dry-run --set fill.walls=2 --set run.threads=1").err.find("note:"), std::string::npos);
  EXPECT_EQ(done("jet part.stl --layer 1 --dry-run --fill raster --set fill.loops=2").err.find("note:"), std::string::npos);
  write_text(folder / "walls.toml", "[layers]\nthickness_mm = 1\n[fill]\nwalls = 2\n[[part]]\npath = 'part.stl'\n");
  EXPECT_NE(done("jet --job walls.toml --dry-run").err.find("note: nothing is filled inside"), std::string::npos);
  EXPECT_EQ(done("jet --job walls.toml --dry-run --set fill.pattern=none").err.find("note:"), std::string::npos);
  const std::string slices = "slice part.stl --layer 1 --walls 1 --overwrite -o out --format ";
  const Outcome dropped = done(slices + "3mf"), drawn = done(slices + "svg");
  EXPECT_NE(dropped.err.find("slices of 3MF contain contours only"), std::string::npos) << dropped.err;
  EXPECT_NE(dropped.err.find("m of bead, not in the file"), std::string::npos) << dropped.err;
  EXPECT_NE(drawn.err.find("m of bead\n"), std::string::npos) << drawn.err;
  EXPECT_EQ(drawn.err.find("contours only"), std::string::npos) << drawn.err;
  EXPECT_EQ(run(slices + "3mf --strict").code, 5);
  EXPECT_EQ(done("slice part.stl --layer 1 --overwrite -o out --format 3mf").err.find("contours only"), std::string::npos);
}

TEST_F(OneMeaning, WhatWasRequestedIsAnsweredOnStdout) {
  done("jet part.stl --bed 60x60 --dpi 100 --layer 1 --quiet -o out");
  done("extrude part.stl --quiet -o part.gcode");
  const struct {
    const char *line, *words;
  } rows[] = {
      {"verify out", "out: 4 layers"},
      {"verify part.gcode", "part.gcode: 20 layers"},
      {"preview out -o sheet.png", "sheet.png: 4 of 4 layers"},
      {"preview part.gcode -o layer.svg", "layer.svg: "},
      {"report out -o page.html", "page.html: 4 of 4 layers shown"},
  };
  for (const auto& row : rows) {
    const Outcome outcome = done(row.line);
    EXPECT_NE(outcome.out.find(row.words), std::string::npos) << row.line << "\n" << outcome.err;
    EXPECT_EQ(outcome.err.find(row.words), std::string::npos) << row.line;
  }
  EXPECT_EQ(done("verify out --quiet").out, "");
  EXPECT_EQ(done("report out -o page.html --quiet --overwrite").out, "");
  const Outcome json = done("verify out --json");
  EXPECT_TRUE(nlohmann::json::parse(json.out)["ok"]);
  EXPECT_NE(json.err.find("out: 4 layers"), std::string::npos) << "next to the object";
}

TEST_F(OneMeaning, OutputsHaveTheNamesAndFoldersThatTheirReadersExpect) {
  std::filesystem::create_directory(folder / "parts");
  std::filesystem::rename(folder / "part.stl", folder / "parts/part.stl");
  const Outcome batch = run_lamina({"batch", "parts", "--with", "extrude --layer 0.4", "-o", "out", "--quiet"}, folder.path());
  EXPECT_EQ(batch.code, 0) << batch.err;
  EXPECT_TRUE(std::filesystem::exists(folder / "out/part.gcode"));
  // A saved job is of the command that saved it.
  done("extrude parts/part.stl --layer 0.4 --dry-run --quiet --save-job parts/tube.toml");
  done("batch parts/tube.toml -o saved --quiet");
  EXPECT_TRUE(std::filesystem::exists(folder / "saved/tube.gcode"));
  done("manual -o pages/man1");
  EXPECT_TRUE(std::filesystem::exists(folder / "pages/man1/lamina-jet.1"));
}

TEST_F(OneMeaning, WordsThatAreWrongAreAnsweredByWhatIsRight) {
  const struct {
    const char* line;
    int code;
    const char* words;
  } rows[] = {
      {"jet part.stl --machine nuferb --dry-run", 2, "did you mean 'nuferbj'?"},
      {"extrude part.stl --infill-pattern raster --dry-run", 2, "did you mean '--pattern'?"},
      {"extrude part.stl --infill 20% --dry-run", 2, "give one from 0 to 100 %"},
      {"jet part.stl --set part.3.copies=2 --dry-run", 2, "there is one part"},
      {"jet part.stl part.stl --set part.3.copies=2 --dry-run", 2, "there are 2 parts"},
      {"jet - --dry-run", 3, "parts are not read from standard input"},
      {"preview nosuchdir -o x.svg", 2, "no such directory"},
      {"batch part.stl --memory 1K -o out", 2, "give 48M or more"},
      {"machines --check nosuch", 2, "no machine 'nosuch'"},
      {"jet part.stl --machine marlin --dry-run", 2, "'marlin' is an extrusion printer, of lamina extrude"},
      {"extrude part.stl --machine nuferbj --dry-run", 2, "'nuferbj' is a powder printer, of lamina jet"},
      {"jet part.stl --machine filament.toml --dry-run", 2, "filament.toml: is the profile of an extrusion printer"},
      {"extrude part.stl --machine powder.toml --dry-run", 2, "powder.toml: is the profile of a powder printer"},
      {"machines --check wrong.toml", 2, "wrong.toml:2:14: material.nozzle_mmm: no such key; did you mean 'nozzle_mm'?"},
      {"manual jet slice", 2, "name one command"},
      {"jett part.stl", 2, "unknown command 'jett'; did you mean 'jet'?\n"},
  };
  write_text(folder / "filament.toml", done("machines --show marlin").out);
  write_text(folder / "powder.toml", done("machines --show nuferbj").out);
  write_text(folder / "wrong.toml", "[material]\nnozzle_mmm = 0.4\n");
  for (const auto& row : rows) {
    const Outcome outcome = run(row.line);
    EXPECT_EQ(outcome.code, row.code) << row.line << "\n" << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(row.words), std::string::npos) << outcome.err;
  }
}

TEST_F(OneMeaning, PrintersOfFilamentAreListedShownAndCheckedAsThoseOfPowder) {
  const std::string list = done("machines").out;
  for (const std::string name : {"nuferbj", "hp45", "anet-a8", "fdm-2000"}) {
    EXPECT_NE(list.find(name), std::string::npos);
    EXPECT_NE(done("machines --check " + name).out.find("machine   "), std::string::npos) << name;
    write_text(folder / "shown.toml", done("machines --show " + name).out);
    done("machines --check shown.toml");
  }
}

}  // namespace
}  // namespace lamina::test
