# The picture of section 1 of physical_gradients.md, from runs/averaged_gradient,
# which the command beside it wrote:
#   gnuplot docs/results/physical_gradients_average.gp
set datafile separator ","
first(rule, t) = sprintf("runs/averaged_gradient/%d/path-%s.csv", t, rule)
gradient = "gradient_descent-step_size-1e-2"
inverse = "newton-inverse_gradient-gradient_descent-step_size-1"
# A line for each start: x_0, L, the steps in x_0.
set print $steps
do for [t = -15:31] {
  do for [i = 1:3] {
    stats first(word(gradient." ".inverse." physical_gradient", i), t) skip 1 \
        using ($0 == 0 ? (loss = $2, x = $3) : (d = $3 - x)) nooutput
    if (i == 1) { d1 = d }
    if (i == 2) { d2 = d }
  }
  print x, ",", loss, ",", d1, ",", d2, ",", d
}
set print

set terminal pngcairo noenhanced size 1000,500
set output "physical_gradients_average.png"
set multiplot layout 1,2
set key outside bottom center vertical
set xrange [-0.31:0.63]
set grid
set title "step in x_0, over x_0"
set yrange [-0.3:0.3]
plot $steps using 1:3 with linespoints pointtype 7 pointsize 0.4 title "gradient, times 0.01", \
     "" using 1:4 with points pointtype 4 title "inverse gradient", \
     "" using 1:5 with points pointtype 7 title "physical gradient"
set title "L and what the physical gradient descends, over x_0"
set yrange [0:1.8]
plot $steps using 1:2 with linespoints pointtype 7 pointsize 0.4 title "L", \
     "" using 1:(50 * $5 ** 2) with points pointtype 7 linecolor 3 title "1/2 |10 (x~ - x)|^2"
unset multiplot
