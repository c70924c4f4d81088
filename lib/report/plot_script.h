// The part that all of gnuplot's scripts have in common: a text, not code that
// makes one. What stands above it says what there is; what stands below it sets
// up each panel, and draws it by `@start`, `@of_bands` and `@of_points` where it
// has them, `@of_lines` and, in the last panel, `@key`.
//
// All lines of a panel are drawn in a pass over the data for each dash, because
// a pass takes as long whatever it draws. In the data a blank line ends each
// line.
#ifndef REPORT_PLOT_SCRIPT_H_
#define REPORT_PLOT_SCRIPT_H_

namespace invgrad {

// Above: png, csv, panels, columns, legend (characters of the longest title; 0:
// none), key_lines and key_points (the lines in the legend), maps (1 if there is
// a heat map); and of all lines the arrays title, color and style (1 lines, 2
// points, 3 both). Below, of a panel: p, its first and last line, those with
// bands and with points, and half a cell of its map, w and h.
constexpr char kPlotScript[] = R"gp(
set encoding utf8
rows = (panels + columns - 1) / columns
left = 105; right = 25 + 115 * maps; top = 45; bottom = 70
beside = legend > 0 ? 95 + 9 * legend : 0
broad = panels == 1 ? 900 : rows == 1 ? 600 : 480
room = (2000 - beside) / columns - left - right
broad = room < broad ? room : broad
tall = rows == 1 ? 560 : 400
tall = maps && broad < tall ? broad : tall
width = columns * (left + broad + right) + beside
height = rows * (top + tall + bottom)
set terminal pngcairo size width,height enhanced \
    font 'DejaVu Sans,12' background '#ffffff'
set datafile separator comma
set datafile columnheaders
set border lw 1 lc rgb '#404040'
set grid xtics ytics lt 1 lw 1 lc rgb '#e2e2e2'
set tics nomirror
# Colours that colour-blind readers can tell (Okabe and Ito), then dashes.
array hues[7] = [0x0072b2, 0xe69f00, 0x009e73, 0xd55e00, 0xcc79a7, 0x56b4e9, 0]
hue(i) = i >= 1 && i <= |color| ? hues[color[i] % 7 + 1] : 0
set dashtype 1 solid
set dashtype 2 (9,4)
set dashtype 3 (2,3)
dash(i) = 1 + color[i] / 7 % 3
mark(i) = int(word("7 5 9 11 13", color[i] % 5 + 1))
of(i, name) = column('line') == i ? column(name) : NaN
is_drawn(i, d) = i >= first && i <= last && style[i] != 2 && dash(i) == d
dashed(d, name) = is_drawn(int(column('line')), d) ? column(name) : NaN
cell(name) = column('line') == 0 && column('panel') == p ? column(name) : NaN
viridis = "maxcolors 0 defined (0 '#440154', 1 '#472d7b', 2 '#3b528b', " . \
    "3 '#2c728e', 4 '#21918c', 5 '#28ae80', 6 '#5ec962', 7 '#addc30', " . \
    "8 '#fde725')"
greys = "maxcolors 14 defined (0 '#fafafa', 1 '#a8a8a8')"
set macros
map = "csv using (cell('x')):(cell('y')):(cell('x')-w):(cell('x')+w)" . \
    ":(cell('y')-h):(cell('y')+h):(cell('z'))" . \
    " with boxxyerror lc palette fs solid 1.0 border notitle, "
start = "plot " . (maps ? map : "") . "NaN notitle"
of_bands = ", for [k in bands] csv using (of(int(k),'x'))" . \
    ":(of(int(k),'low')):(of(int(k),'high')) with filledcurves" . \
    " fs transparent solid 0.18 noborder lc rgb hue(int(k)) notitle"
of_lines = ", for [d=1:3] csv using (dashed(d,'x')):(column('y'))" . \
    ":(hue(int(column('line')))) with lines lw 1.8 dt d lc rgb variable notitle"
of_points = ", for [k in points] csv using (of(int(k),'x')):(of(int(k),'y'))" . \
    " with points pt mark(int(k)) ps 0.9 lc rgb hue(int(k)) notitle"
# The legend; an empty list would be taken for one word.
key_of_lines = ", for [k in key_lines] keyentry with linespoints lw 1.8" . \
    " dt dash(int(k)) pt mark(int(k)) ps (style[int(k)] == 1 ? 0 : 0.9)" . \
    " lc rgb hue(int(k)) title title[int(k)]"
key_of_points = ", for [k in key_points] keyentry with points pt mark(int(k))" . \
    " ps 0.9 lc rgb hue(int(k)) title title[int(k)]"
key = (strlen(key_lines) > 0 ? key_of_lines : "") . \
    (strlen(key_points) > 0 ? key_of_points : "")
set output png
set multiplot layout rows,columns margins left / real(width), \
    1 - (right + beside) / real(width), bottom / real(height), \
    1 - top / real(height) spacing (left + right) / real(width), \
    (top + bottom) / real(height)
set key at screen 1 - (beside - 20) / real(width), \
    screen 1 - top / real(height) left top Left reverse noenhanced \
    samplen 2.5 spacing 1.15
)gp";

}  // namespace invgrad

#endif  // REPORT_PLOT_SCRIPT_H_
