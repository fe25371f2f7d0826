// stages/heights/greedy.h: the ways that decide one layer after the other, from the bottom up.
#pragma once

#include "stages/heights/candidate_heights.h"
#include "stages/heights/heights.h"

namespace lamina::heights {

/// Figure 3.5 of M. V. A. de Lima, "Modelo de fatiamento adaptativo para prototipagem rapida", UTFPR, 2009. A layer
/// starts with the greatest thickness and gets the next thinner one while a slope is at least as flat as the angle, or
/// else while a flat lies in it or on top of it and the least thickness still fits below that flat, or it leaves the
/// part. What is left at the top is not built if it is less than the least thickness; with cover_top it is, by another
/// division of the last layer or by one layer more.
Plan plan_by_angle(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights);

/// A. Dolenc and I. Makela, "Slicing procedures for layered manufacturing techniques", Computer-Aided Design 26 (1994):
/// the greatest thickness of which no slope in the layer gets a step above the limit. The top is covered by the least
/// thickness that does.
Plan plan_by_cusp(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights);

/// E. Sabourin, S. A. Houser and J. H. Bohn, "Adaptive slicing using stepwise uniform refinement", Rapid Prototyping
/// Journal 2 (1996): slabs of the greatest thickness, each divided evenly into as many layers as the flattest slope in
/// it needs, at most greatest / least.
Plan plan_stepwise(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights);

}  // namespace lamina::heights
