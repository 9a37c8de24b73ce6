// Tuned constants of the automatic choice. docs/method.md has them in a table with the models they were confirmed on.
#pragma once
#include <cstdint>

namespace lamina {

/// H where nobody says another and nothing asks for one.
inline constexpr double kDefaultBlend = 1.2;

/// Samples this far (radii) from the surface that their neighbours suggest are noisy. Detail that the sampling hardly
/// resolves looks the same up to 0.05; noise of half a spacing either way has 0.12, of a spacing 0.3.
inline constexpr float kNoisy = 0.05F;

/// From so little on such samples are noisy where the supports that their neighbours ask for are so wide (H) in the
/// middle: detail asks for narrow ones, noise for wide ones.
inline constexpr float kPerhapsNoisy = 0.025F;
inline constexpr float kNoiseSupport = 1.5F;

/// H of a noisy cloud in which no sample has enough neighbours to tell how wide supports should be.
inline constexpr double kNoisyBlend = 1.75;

/// Support (H) within which noisy normals are fitted again. Normals found over a handful of neighbours scatter by 13
/// degrees on noisy samples, those of scanners and of neighbourhoods that know the noise by two to eight; the former
/// want more company.
inline constexpr float kRefitPerBlend = 1.2F;
inline constexpr float kRoughRefitPerBlend = 1.6F;
inline constexpr double kRoughNormals = 10;

/// Radii of an evenly sampled surface: the 99 % quantile is some 2.5 times the 1 % one (cells that the surface clips
/// give long ones), six to eight where density varies 64 times. Where density varies, the support must bridge wider
/// gaps.
inline constexpr float kEven = 3;

/// Share of samples without neighbours on all sides from which on a clean cloud may lie on lines: of clean objects it
/// is under 0.1, of lines twelve times as far apart as their samples 0.9.
inline constexpr float kLopsided = 0.3F;
/// Largest leaf cell (R) where samples lie on lines: the middle between two is 0.6 R from either, and half a cell more.
inline constexpr double kLinesCell = 0.5;

/// Largest leaf cell (sample radii) where it is chosen: no more than 1.3 M triangles of a million samples.
inline constexpr double kChosenCell = 0.892;

/// The same of an even cloud with next to no noise (kSharp), which has detail to show, whose mesh loses triangles where
/// it is flat: it has no more of them then, and is nearer to the truth.
inline constexpr double kThinnedCell = 0.84;

/// The same of a noisy cloud whose mesh loses triangles where it is flat: edges and rims are cut more finely, and
/// normals follow.
inline constexpr double kNoisyCell = 0.7;

/// The same where a number of triangles is wanted: cells whose full mesh has kFullForWanted times as many, so that
/// there is something to choose from, but no smaller than kFinestCell.
inline constexpr double kFinestCell = 0.63;
inline constexpr double kFullForWanted = 2;

/// What a sample stands for of the surface, square radii.
inline constexpr double kSampleArea = 0.25;

/// How far from its nearest sample a corner keeps a value (cells): less on noise, whose outermost samples would make
/// sheets of their own, but so many radii where cells are much smaller; more where cells between two sheets are half as
/// large, so that values reach as far as before.
inline constexpr float kNoisyBand = 1.5F;
inline constexpr float kNoisyReach = 0.6F;
inline constexpr float kSheetBand = 4;

/// How far (cells) from the tangent planes of an even cloud's samples corners get values. Ends of edges that the
/// surface crosses are no farther than one; beyond it values are worth next to nothing.
inline constexpr float kEvenHeight = 1.15F;

/// How far (support radii) a corner's projection may lie from its samples' mean, and how many must act, to be trusted.
inline constexpr float kEvenTrust = 0.3F;
inline constexpr int kEvenTrustedSamples = 4;

/// Overhang (support radii) along which rims are cut. The straight edge of evenly spread samples has 0.235; a wide
/// support averages chance out, so noisy clouds can be cut a little inside of it, which takes most of the flakes of
/// strays along.
inline constexpr double kRimOverhang = 0.19;
/// And so much less for each by which the usual H is more than this: the same way from the samples is a smaller share
/// of a wider support.
inline constexpr double kRimOverhangPerBlend = 0.01;
inline constexpr double kRimBlend = 2;
inline constexpr double kCleanRimOverhang = 0.35;

/// Rims up to this long (R) are closed where nobody says otherwise and the surface around tells how: gaps some hundred
/// radii wide, as dark, shiny or hidden places leave. The bound keeps what a run remembers of rims small.
inline constexpr double kLongestRim = 300;

/// Connected parts under which fewer samples lie are left out where nobody says otherwise, however many triangles they
/// have: sheets of stray samples, each of which makes a disc of its own, and what noise leaves over. What a scan really
/// saw has more, be it a bar of a window or the leg of a chair.
inline constexpr std::uint64_t kSpeckSamples = 60;
/// Of small clouds fewer: one in so many of all. A part of a single triangle goes even so.
inline constexpr std::uint64_t kSpeckShare = 5000;
inline constexpr std::uint64_t kSpeckTriangles = 2;

/// How far the mesh may be off its planes where triangles go (SimplifySettings::deviation): of clean samples, what each
/// radius of median residual adds, and the most.
inline constexpr double kCleanDeviation = 0.01;
inline constexpr double kNoiseDeviation = 0.15;
inline constexpr double kMostDeviation = 0.05;

/// The size of most cells in units of the largest the median radius allows: with 0.64 the radii of an evenly sampled
/// surface (which scatter by 0.75 to 1.25 around their median) all ask for the same level.
inline constexpr double kMainCell = 0.7;

/// Half the side of a counting cell of 16 samples in radii: two radii wide, with room for scatter.
inline constexpr double kCountingHalfWidth = 1.15;

/// Noise (r) up to which sharp edges stand out: detail that the sampling hardly resolves has more, and bends
/// everywhere.
inline constexpr float kSharp = 0.03F;
/// Share of samples with normals interpolated over sharp edges from which on such normals are found again.
inline constexpr double kBlurred = 0.01;
/// Median residual (r) up to which positions are exact enough to judge normals by: rough detail has more.
inline constexpr double kExact = 0.01;

}  // namespace lamina
