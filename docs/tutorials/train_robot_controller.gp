# Draws the picture of train_robot_controller.md from the text files:
#   gnuplot train_robot_controller.gp
set terminal pngcairo size 1200,520
set output "train_robot_controller.png"
set multiplot layout 1,2

set title "parking"
set xlabel "seconds of training"
set ylabel "test loss"
set logscale xy
set yrange [1e-17:*]  # leaves room for the legend
set format y "10^{%L}"
set key bottom left Left reverse noenhanced
plot for [i = 0:*] "robot_losses.txt" index i \
  with lines linewidth 2 title columnheader(1)

set title "twelve parkings by the rule with the least test loss"
set xlabel "x [m]"
set ylabel "y [m]"
unset logscale
set autoscale y
set format y "%g"
unset key
set size ratio -1
plot "robot_paths.txt" with linespoints pointtype 7 pointsize 0.5
