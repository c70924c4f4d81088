# The picture of section 6 of physical_gradients.md:
#   example_trained_networks trained_networks.txt
#   gnuplot trained_networks.gp
set terminal pngcairo noenhanced size 1000,460
set output "physical_gradients_ensemble.png"
file = "trained_networks.txt"
first = 3  # column
last = 22
n = last - first + 1.0
mean(unused) = sum [i = first:last] column(i) / n
mean_square(unused) = sum [i = first:last] column(i) ** 2 / n
mean_size(unused) = sum [i = first:last] abs(column(i)) / n
mean_square_error(unused) = sum [i = first:last] (abs(column(i)) - $2) ** 2 / n
set multiplot layout 1,2
set xrange [0:1.5]
set grid
set key outside bottom center vertical
set arrow 1 from 1, graph 0 to 1, graph 1 nohead dashtype 2
set label 1 "trained up to here" at 0.98, graph 0.05 right
set title "x of 20 networks, over y*"
plot for [i = first:last] file using 1:i with lines \
         linecolor rgb "#8080ff" title i == first ? "networks" : "", \
     for [sign in "1 -1"] file using 1:(sign * $2) with lines dashtype 3 \
         linecolor rgb "black" title sign eq "1" ? "pre-images" : ""
set title "spread and error, over y*"
set logscale y
set yrange [1e-3:3]
plot file using 1:(sqrt(mean_square(0) - mean(0) ** 2)) with lines \
         linewidth 2 title "deviation of x", \
     "" using 1:(sqrt(mean_square(0) - mean_size(0) ** 2)) with lines \
         linewidth 2 title "deviation of |x|", \
     "" using 1:(sqrt(mean_square_error(0))) with lines linewidth 2 dashtype 3 \
         linecolor rgb "black" title "error of a network"
unset multiplot
